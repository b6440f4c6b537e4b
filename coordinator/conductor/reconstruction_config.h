// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "common/geometry/camera.h"
#include "common/job/camera_job_spec.h"
#include "common/mesh/joined_mesh.h"
#include "coordinator/conductor/conductor.h"

namespace meshwright {

// What a reconstruction's options mean for the coordinator. Most of them are the workers', who are handed
// `options_json`; the coordinator knows nothing of how jobs are done.
struct ReconstructionConfig {
  std::string options_json;  // canonical: every option with its value
  int max_image_size = 0;    // px, 0: as they are
  int refine_cameras = 0;    // in scenes of at most so many photographs
  ConductorOptions conductor;
  JoinOptions join;
  // Bytes that the job takes at most, its input included.
  std::function<int64_t(const CameraJobSpec& spec, const std::vector<Camera>& cameras)> job_bytes;
};

// InvalidArgument names the option, its value and what was expected.
using ParseReconstructionConfig = std::function<absl::StatusOr<ReconstructionConfig>(const std::string& options_json)>;

}  // namespace meshwright
