// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <absl/status/status.h>

#include "coordinator/main/coordinator_program.h"

namespace meshwright {

// See CoordinatorProgram::Check.
absl::Status CheckSettings(const CoordinatorSettings& settings);

}  // namespace meshwright
