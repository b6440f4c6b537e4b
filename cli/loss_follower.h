#pragma once

#include <memory>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

#include "pipeline/local/local_reconstruction.h"
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
  // Compares the mesh with the ground truth; adds "losses" to the report and to report.json, and prints them on stderr.
  virtual absl::Status Account(const LocalSettings& settings, nlohmann::ordered_json& report) = 0;
};

// `ground_truth`: a PLY mesh. What is passed by reference must outlive the follower. Errors: bad input; Unimplemented
// in a build without tools/.
absl::StatusOr<std::unique_ptr<LossFollower>> FollowLosses(const std::string& ground_truth, const Scene& scene,
                                                           const ReconstructionOptions& options, ThreadPool& pool);

}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
