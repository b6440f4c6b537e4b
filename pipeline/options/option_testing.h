// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>
#include <nlohmann/json.hpp>

#include "pipeline/options/option_table.h"

namespace meshwright {

// What tests of every way into the program try with every option of the table.

inline OptionValue Bound(const Option& option, double bound) {
  if (option.is_integer()) return static_cast<int64_t>(bound);
  return bound;
}

// Options with this value of one, and of those that it bounds the nearest that go with it: names and values.
inline std::vector<std::pair<const Option*, OptionValue>> ValuesWith(const Option& option, double value) {
  std::vector<std::pair<const Option*, OptionValue>> values = {{&option, Bound(option, value)}};
  for (const OptionRelation& relation : OptionRelations()) {
    const Option* const smaller = FindOption(relation.smaller);
    const Option* const larger = FindOption(relation.larger);
    if (&option == smaller) values.emplace_back(larger, Bound(*larger, larger->maximum));
    if (&option == larger) values.emplace_back(smaller, Bound(*smaller, smaller->minimum));
  }
  return values;
}

inline ReconstructionOptions WithValue(const Option& option, double value) {
  ReconstructionOptions options;
  for (const auto& [set, to] : ValuesWith(option, value)) set->Set(options, to);
  return options;
}

// {"support": 255}
inline std::string JsonWithValue(const Option& option, double value) {
  nlohmann::ordered_json json;
  for (const auto& [set, to] : ValuesWith(option, value)) {
    std::visit([&, name = set->name](auto number) { json[name] = number; }, to);
  }
  return json.dump();
}

// Values just beyond the bounds and far beyond them, and what is no number.
inline std::vector<std::string> RefusedTexts(const Option& option) {
  std::vector<std::string> texts = {
      "-9223372036854775808", "9223372036854775807", "-2147483649", "2147483648", "nan", "inf", "many"};
  if (option.is_integer()) {
    texts.push_back(absl::StrCat(static_cast<int64_t>(option.minimum) - 1));
    texts.push_back(absl::StrCat(static_cast<int64_t>(option.maximum) + 1));
    texts.push_back(absl::StrCat(static_cast<int64_t>(option.minimum), ".5"));
  } else {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    for (const double value :
         {std::nextafter(option.minimum, -kInfinity), std::nextafter(option.maximum, kInfinity), -1e300, 1e300}) {
      texts.push_back(nlohmann::json(value).dump());
    }
  }
  return texts;
}

inline bool IsJsonNumber(const std::string& text) {
  return nlohmann::json::parse(text, nullptr, /*allow_exceptions=*/false).is_number();
}

}  // namespace meshwright
