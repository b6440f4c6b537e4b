#pragma once

#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "coordinator/main/coordinator_program.h"

namespace meshwright {

// See CoordinatorProgram::Check.
absl::Status CheckSettings(const CoordinatorSettings& settings);

// The token that a file holds, without blanks around it; "" where `path` is "". InvalidArgument where it is too short
// to be a secret; NotFound and PermissionDenied name the file.
absl::StatusOr<std::string> ReadApiToken(const std::string& path);

}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
