// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "coordinator/conductor/reconstruction_config.h"

namespace meshwright {

// What a reconstruction's options (see ParseOptions) mean for the coordinator, with the memory that the worker rooms
// say a job needs. InvalidArgument names the option, its value and what was expected.
absl::StatusOr<ReconstructionConfig> ParseConfig(const std::string& options_json);

}  // namespace meshwright
