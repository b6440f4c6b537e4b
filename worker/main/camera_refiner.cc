// SPDX-License-Identifier: Apache-2.0
#include "worker/main/camera_refiner.h"

#include "pipeline/options/options_json.h"
#include "pipeline/refinement/refine_cameras.h"

#include "common/base/status_macros.h"
#include "worker/job_input/blob_views.h"

namespace meshwright {

CameraRefiner MakeCameraRefiner() {
  return [](const Scene& scene, const std::string& options_json, BlobStore& blobs, ThreadPool& pool,
            const std::function<bool(double)>& progress) -> absl::StatusOr<CameraRefinement> {
    MW_ASSIGN_OR_RETURN(const ReconstructionOptions options, ParseOptions(options_json));
    const auto load = [&](CameraIndex camera, int max_image_size) {
      return LoadViewFromBlobs(scene.views[static_cast<size_t>(camera)], max_image_size, blobs);
    };
    return RefineCameras(scene, options, {.load = load, .pool = &pool, .progress = progress});
  };
}

}  // namespace meshwright
