// SPDX-License-Identifier: Apache-2.0
#include "common/base/relative_path.h"

#include <vector>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>

#include "common/base/utf8.h"

namespace meshwright {
namespace {

constexpr size_t kMaxPathLength = 1024;

}  // namespace

absl::Status ValidateRelativePath(const std::string& path) {
  if (path.size() > kMaxPathLength) {
    return absl::InvalidArgumentError(
        absl::StrCat("path has ", path.size(), " characters, expected at most ", kMaxPathLength));
  }
  bool valid = !path.empty() && path.find('\0') == std::string::npos;
  for (const std::string& part : std::vector<std::string>(absl::StrSplit(path, '/'))) {
    valid = valid && !part.empty() && part != "." && part != "..";
  }
  if (valid && IsUtf8(path)) return absl::OkStatus();
  if (valid) return absl::InvalidArgumentError(absl::StrCat("path \"", ToUtf8(path), "\": a name in UTF-8 expected"));
  return absl::InvalidArgumentError(
      absl::StrCat("path \"", ToUtf8(path.substr(0, 100)), "\": a relative path inside the scene's folder expected"));
}

}  // namespace meshwright
