// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

namespace meshwright {

// The descriptor of a new file in the folder of `path` that has no name: its space goes back when the descriptor
// closes, however the process ends. Errors are those of NamelessFileError.
absl::StatusOr<int> CreateNamelessFile(const std::string& path);

// What could not be done ("write") with the file beside `path`: ResourceExhausted when the disk is full, else Internal.
absl::Status NamelessFileError(const std::string& what, const std::string& path, int error);

}  // namespace meshwright
