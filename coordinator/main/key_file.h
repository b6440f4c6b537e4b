// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/status.h>

namespace meshwright {

// Writes a new key into the file, unless it is there.
absl::Status MakeKeyFile(const std::string& path);

}  // namespace meshwright
