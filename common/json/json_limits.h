// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>

#include <absl/status/status.h>

namespace meshwright {

// What a JSON text from outside may be. Whoever walks through a value (to print, copy or compare it) needs stack for
// each level, so depth has to be known before.
struct JsonLimits {
  size_t max_bytes = size_t{64} << 10;
  int max_depth = 8;  // arrays and objects within each other; 0 for a lone number or string
};

// InvalidArgument, to be put behind the name of what the text is: "has 70000 bytes, expected at most 65536". Says
// nothing of whether it is JSON.
absl::Status CheckJsonLimits(const std::string& text, const JsonLimits& limits);

}  // namespace meshwright
