// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "coordinator/conductor/reconstruction_driver.h"

namespace meshwright {

// Photographs below `folder` and their masks, as the stage that estimates cameras takes them.
absl::StatusOr<std::vector<PhotographFile>> ListPhotographFiles(const std::string& folder);

}  // namespace meshwright
