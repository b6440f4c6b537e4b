// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <limits>
#include <utility>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/strings/str_cat.h>

namespace meshwright {

// The whole number of type T that a JSON value from outside is. nlohmann's own get<T>() takes 1e99 and 2.5 for whole
// numbers, and those that T has no room for. InvalidArgument: it is none of T.
template <typename T, typename Json>
absl::StatusOr<T> WholeNumber(const Json& json) {
  if (json.is_number_unsigned()) {
    const auto number = json.template get<uint64_t>();
    if (std::in_range<T>(number)) return static_cast<T>(number);
  } else if (json.is_number_integer()) {
    const auto number = json.template get<int64_t>();
    if (std::in_range<T>(number)) return static_cast<T>(number);
  }
  return absl::InvalidArgumentError(absl::StrCat("expected a whole number from ", std::numeric_limits<T>::min(), " to ",
                                                 std::numeric_limits<T>::max()));
}

}  // namespace meshwright
