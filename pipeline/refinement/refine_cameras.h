// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include <absl/status/statusor.h>

#include "pipeline/options/reconstruction_options.h"

#include "common/base/ids.h"
#include "common/base/thread_pool.h"
#include "common/job/camera_refinement.h"
#include "common/scene/scene.h"
#include "common/scene/view.h"

namespace meshwright {

struct RefinementEnvironment {
  // A view of the scene, ready for use. Its errors are RefineCameras'.
  std::function<absl::StatusOr<View>(CameraIndex camera, int max_image_size)> load;
  ThreadPool* pool = nullptr;
  // How much is done, in [0, 1]; false: stop.
  std::function<bool(double done)> progress;
};

// Ours: cameras that are a little wrong (other programs', or a rig's that has moved) tear surfaces apart, as windows of
// one patch lie beside each other. Seeds of all references (section 3.5) are measured in their targets wherever the
// cameras say they are, and cameras moved to where the measurements agree (bundle adjustment), on photographs of a
// quarter, half and the full of kRefinedOn, coarse to fine, so that several pixels are found too. What was gained is
// judged on points that had no say; cameras that agree already stay as they are, to the last bit. The cameras' common
// frame stays too: the points lie where they lay on the average.
//
// A function of photographs, cameras, points and options, whatever the number of threads. Cancelled: stopped. Scenes
// that are refused later on (no pair), and those with more photographs than options.refine_cameras, are not touched.
absl::StatusOr<CameraRefinement> RefineCameras(const Scene& scene, const ReconstructionOptions& options,
                                               const RefinementEnvironment& environment);

constexpr int kRefinedOn = 1000;  // px, longest side of the photographs used, at most

}  // namespace meshwright
