// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <absl/status/status.h>

namespace meshwright {

// Marks an error as the input's fault (exit code 3) rather than the machine's (exit code 1). OK stays OK.
absl::Status BadInput(absl::Status status);
bool IsBadInput(const absl::Status& status);

}  // namespace meshwright
