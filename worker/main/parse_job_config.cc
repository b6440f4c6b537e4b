// SPDX-License-Identifier: Apache-2.0
#include "worker/main/parse_job_config.h"

#include "pipeline/options/options_json.h"

#include "common/base/status_macros.h"

namespace meshwright {

absl::StatusOr<JobConfig> ParseJobConfig(const std::string& options_json) {
  MW_ASSIGN_OR_RETURN(const ReconstructionOptions options, ParseOptions(options_json));
  return JobConfig{.max_image_size = options.max_image_size, .job = options.job};
}

}  // namespace meshwright
