// SPDX-License-Identifier: Apache-2.0
#include "common/json/json_limits.h"

#include <algorithm>

#include <absl/strings/str_cat.h>

namespace meshwright {
namespace {

// Of brackets outside of strings. Where the text is no JSON it counts at least what a parser would open before it
// notices.
int DepthOf(const std::string& text) {
  int depth = 0;
  int deepest = 0;
  bool in_string = false;
  for (size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_string) {
      if (c == '\\') ++i;
      in_string = c != '"';
    } else if (c == '"') {
      in_string = true;
    } else if (c == '[' || c == '{') {
      deepest = std::max(deepest, ++depth);
    } else if (c == ']' || c == '}') {
      --depth;
    }
  }
  return deepest;
}

}  // namespace

absl::Status CheckJsonLimits(const std::string& text, const JsonLimits& limits) {
  if (text.size() > limits.max_bytes) {
    return absl::InvalidArgumentError(absl::StrCat("has ", text.size(), " bytes, expected at most ", limits.max_bytes));
  }
  if (const int depth = DepthOf(text); depth > limits.max_depth) {
    return absl::InvalidArgumentError(
        absl::StrCat("is nested ", depth, " levels deep, expected at most ", limits.max_depth));
  }
  return absl::OkStatus();
}

}  // namespace meshwright
