// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

#include "pipeline/options/reconstruction_options.h"

#include "common/base/thread_pool.h"
#include "common/scene/scene.h"
#include "common/surface/patch_lattice.h"
#include "worker/camera_job/camera_job.h"

namespace meshwright {

// Watches a reconstruction and tells at which stage ground-truth pixels were lost (reconstruct --ground-truth).
class LossFollower {
 public:
  virtual ~LossFollower() = default;
  virtual CameraJobResult RunJob(const CameraJobInput& input, ThreadPool& pool) = 0;
  virtual void RecordAccepted(const PatchLattice& accepted) = 0;
  // Compares the mesh with the ground truth and adds "losses" to the report.
  virtual absl::Status Account(const std::string& ply_path, nlohmann::ordered_json& report) = 0;
  // The same in words; "" before.
  virtual const std::string& Words() const = 0;
};

// `ground_truth`: a PLY mesh. What is passed by reference must outlive the follower. Errors: bad input; Unimplemented
// in a build without tools/.
absl::StatusOr<std::unique_ptr<LossFollower>> FollowLosses(const std::string& ground_truth, const Scene& scene,
                                                           const ReconstructionOptions& options, ThreadPool& pool);

}  // namespace meshwright
