// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/status.h>

namespace meshwright {

// InvalidArgument (naming the field `path`) unless it is a relative path that stays inside: no "..", no empty part, at
// most 1024 characters, UTF-8.
absl::Status ValidateRelativePath(const std::string& path);

}  // namespace meshwright
