// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "worker/agent/job_contexts.h"

namespace meshwright {

// What a reconstruction's options (see ParseOptions) mean for a worker. InvalidArgument names the option, its value and
// what was expected.
absl::StatusOr<JobConfig> ParseJobConfig(const std::string& options_json);

}  // namespace meshwright
