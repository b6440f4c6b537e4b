// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>

namespace meshwright {

// "growing.min_quality is 2, expected -1..1": a field of options whose value is none of those allowed.
template <typename T>
absl::Status OutOfRange(const std::string& field, const T& value, const std::string& expected) {
  return absl::InvalidArgumentError(absl::StrCat(field, " is ", value, ", expected ", expected));
}

}  // namespace meshwright
