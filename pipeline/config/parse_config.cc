// SPDX-License-Identifier: Apache-2.0
#include "pipeline/config/parse_config.h"

#include "pipeline/options/options_json.h"

#include "common/base/status_macros.h"
#include "common/json/json_text.h"
#include "worker/job_input/camera_job_input.h"

namespace meshwright {

absl::StatusOr<ReconstructionConfig> ParseConfig(const std::string& options_json) {
  MW_ASSIGN_OR_RETURN(const ReconstructionOptions options, ParseOptions(options_json));
  ReconstructionConfig config = {.options_json = JsonText(ToJson(options)),
                                 .max_image_size = options.max_image_size,
                                 .refine_cameras = options.refine_cameras,
                                 .conductor = options.conductor,
                                 .join = options.join};
  config.conductor.lattice_step = options.job.lattice_step;
  config.job_bytes = [job = options.job](const CameraJobSpec& spec, const std::vector<Camera>& cameras) {
    const CameraJobOptions reduced = Reduced(job, spec.reduction);
    return EstimateInputBytes(spec, cameras, reduced.lattice_step) +
           EstimateCameraJobBytes(cameras[static_cast<size_t>(spec.camera)], reduced);
  };
  return config;
}

}  // namespace meshwright
