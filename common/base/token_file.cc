// SPDX-License-Identifier: Apache-2.0
#include "common/base/token_file.h"

#include <algorithm>

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>

#include "common/base/files.h"
#include "common/base/status_macros.h"

namespace meshwright {
namespace {

constexpr size_t kMinLength = 16;

}  // namespace

absl::StatusOr<std::string> ReadTokenFile(const std::string& path, const std::string& flag) {
  if (path.empty()) return std::string();
  MW_ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
  std::string token(absl::StripAsciiWhitespace(text));
  if (token.size() < kMinLength) {
    return absl::InvalidArgumentError(absl::StrCat(flag, " is ", path, ", whose token has ", token.size(),
                                                   " characters, expected at least ", kMinLength));
  }
  // It travels in a header.
  if (!std::all_of(token.begin(), token.end(), [](unsigned char c) { return absl::ascii_isgraph(c); })) {
    return absl::InvalidArgumentError(absl::StrCat(flag, " is ", path, ", whose token has more than visible ASCII"));
  }
  return token;
}

}  // namespace meshwright
