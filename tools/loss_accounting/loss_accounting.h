// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/types/span.h>
#include <nlohmann/json.hpp>

#include "tools/raycast/depth_map.h"
#include "tools/raycast/mesh_ray_caster.h"

#include "common/base/mutex.h"
#include "common/base/thread_pool.h"
#include "common/mesh/triangle_mesh.h"
#include "common/surface/patch_lattice.h"
#include "worker/camera_job/camera_job.h"

namespace meshwright {

// How far the true surface of a missing ground-truth pixel came: the furthest that any camera that sees it took it.
enum class LossStage : uint8_t {
  kSeenByOne,     // fewer than two cameras see it: nothing could be done
  kInconsistent,  // in no camera that got to it does the true patch itself reach the threshold of growing
  kHidden,        // behind accepted surface that is false
  kNotReached,    // the true patch would pass, but no patch was grown there (seeds, growing)
  kFiltered,      // grown, and dropped or replaced by the MRF
  kUnsupported,   // in the filtered surface of one camera alone
  kRefused,       // in those of several, and accepted in none: outvoted
  kLostInJoin,    // accepted, and not in the joined mesh: trimmed, or part of a small piece
};
constexpr size_t kLossStages = 8;
std::string Describe(LossStage stage);

struct LossReport {
  int64_t ground_truth_pixels = 0;
  int64_t found = 0;  // of them: within kToleranceInFootprints of the mesh
  std::array<int64_t, kLossStages> lost = {};
  int cameras_not_followed = 0;  // done by an earlier process: what they grew is not known
};

nlohmann::ordered_json ToJson(const LossReport& report);
std::string ToText(const LossReport& report);

// Follows a reconstruction whose ground truth is known, and says of every ground-truth pixel that is missing in the end
// which stage lost it. A patch is right when its centre lies within the tolerance of the true surface's tangent plane
// on its ray. Memory: a depth map and a byte per node for each camera.
class LossAccounting {
 public:
  static constexpr double kToleranceInFootprints = 2;  // g = depth / focal

  // InvalidArgument when a face names no vertex.
  static absl::Status Check(const TriangleMesh& ground_truth);

  // Every camera of the scene, at the size at which they are used.
  LossAccounting(const TriangleMesh& ground_truth, std::vector<Camera> cameras, int lattice_step, ThreadPool& pool);

  // After a camera's job, in any order and from any thread. `grown` is G_r, `filtered` F_r.
  void RecordJob(const CameraJobInput& input, const CameraJobOptions& options, const PatchStacks& grown,
                 const PatchLattice& filtered, ThreadPool& pool);
  // M_r of a camera.
  void RecordAccepted(const PatchLattice& accepted);

  LossReport Account(const TriangleMesh& mesh, ThreadPool& pool) const;

 private:
  // What one camera did on one ray, in the order of the stages.
  enum class Outcome : uint8_t { kUnknown, kInconsistent, kHidden, kNotReached, kGrown, kFiltered, kAccepted };

  double PlaneDistanceInFootprints(CameraIndex camera, size_t node, double depth) const;
  bool IsRight(CameraIndex camera, size_t node, double depth) const;
  Outcome OutcomeOfJob(const CameraJobInput& input, const PatchScorer& scorer, const CameraJobOptions& options,
                       const PatchStacks& grown, const PatchLattice& filtered, size_t node) const;
  LossStage StageOf(const Eigen::Vector3d& x_in_world) const;

  const std::vector<Camera> cameras_;
  std::vector<DepthMap> truth_;                 // per camera
  std::vector<std::vector<Outcome>> outcomes_;  // per camera and node
  Mutex mutex_;                                 // over outcomes_
};

}  // namespace meshwright
