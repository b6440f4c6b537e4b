// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <absl/status/status.h>

#include "common/mesh/joined_mesh.h"
#include "coordinator/options/conductor_options.h"
#include "worker/camera_job/camera_job.h"

namespace meshwright {

// Everything beside the scene that the mesh depends on. Threads, memory and paths are not among it. What users can set
// of it, under which name and within which bounds, is in option_table.h.
struct ReconstructionOptions {
  int max_image_size = 0;     // px, longest side of the images used; 0: as they are
  int refine_cameras = 3000;  // cameras are refined in scenes of at most so many photographs; 0: never
  CameraJobOptions job;
  ConductorOptions conductor;
  JoinOptions join;

  // InvalidArgument names the option, its value and the values allowed.
  absl::Status Validate() const;
};

}  // namespace meshwright
