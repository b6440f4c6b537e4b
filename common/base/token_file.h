// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/statusor.h>

namespace meshwright {

// The token in a file, without blanks around it; "" for the path "". `flag` is the setting that names the file. Errors:
// those of ReadFile; InvalidArgument when it has less than 16 characters or something that is no visible ASCII.
absl::StatusOr<std::string> ReadTokenFile(const std::string& path, const std::string& flag);

}  // namespace meshwright
