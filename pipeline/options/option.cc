// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>

#include "pipeline/options/option_table.h"

#include "common/base/check.h"
#include "common/base/nearest_name.h"
#include "common/base/status_macros.h"

namespace meshwright {
namespace {

constexpr size_t kMostShown = 40;  // characters of what the user wrote

double AsDouble(OptionValue value) {
  return std::visit([](auto number) { return static_cast<double>(number); }, value);
}

bool IsAllowed(const Option& option, OptionValue value) {
  const double number = AsDouble(value);  // bounds are far below 2^53: whole numbers near them are exact
  return number >= option.minimum && number <= option.maximum;
}

absl::Status Refuse(const Option& option, const std::string& text, const std::string& prefix) {
  return absl::InvalidArgumentError(absl::StrCat(prefix, option.name, " is ", text.substr(0, kMostShown),
                                                 ", expected a ", option.is_integer() ? "whole number" : "number",
                                                 " from ", DescribeRange(option)));
}

// "2 * --mrf-margin (50) + 2 = 102".
std::string DescribeLeast(const OptionRelation& relation, OptionValue smaller, double least,
                          const std::string& prefix) {
  std::string text = relation.factor == 1 ? "" : absl::StrCat(relation.factor, " * ");
  absl::StrAppend(&text, prefix, relation.smaller, " (", FormatValue(smaller), ")");
  if (relation.offset != 0) absl::StrAppend(&text, " + ", relation.offset);
  if (relation.factor != 1 || relation.offset != 0) absl::StrAppend(&text, " = ", least);
  return text;
}

}  // namespace

OptionValue Option::Get(const ReconstructionOptions& options) const {
  // One accessor for both ways; nothing is written here.
  auto& writable = const_cast<ReconstructionOptions&>(options);  // NOLINT(cppcoreguidelines-pro-type-const-cast)
  return std::visit(
      [&](auto access) -> OptionValue {
        const auto value = access(writable);
        if constexpr (std::is_integral_v<decltype(value)>) return int64_t{value};
        return double(value);
      },
      field);
}

void Option::Set(ReconstructionOptions& options, OptionValue value) const {
  MW_CHECK(IsAllowed(*this, value) && is_integer() == std::holds_alternative<int64_t>(value));
  std::visit(
      [&](auto access) {
        auto& member = access(options);
        using Member = std::remove_reference_t<decltype(member)>;
        member = std::visit([](auto number) { return static_cast<Member>(number); }, value);
      },
      field);
}

const Option* FindOption(const std::string& name) {
  const auto found = std::ranges::find_if(OptionTable(), [&](const Option& option) { return option.name == name; });
  return found == OptionTable().end() ? nullptr : &*found;
}

std::string DescribeUnknownOption(const std::string& name, const std::string& prefix) {
  std::vector<std::string> names;
  for (const Option& option : OptionTable()) names.emplace_back(option.name);
  return absl::StrCat("there is no option \"", prefix, name.substr(0, kMostShown), "\"",
                      DidYouMean(name, names, prefix));
}

std::string FormatValue(OptionValue value) {
  return std::visit([](auto number) { return absl::StrCat(number); }, value);
}

std::string DescribeRange(const Option& option) {
  const auto bound = [&](double value) {
    return option.is_integer() ? absl::StrCat(std::llround(value)) : absl::StrCat(value);
  };
  const std::string unit = *option.unit == '\0' ? "" : absl::StrCat(" ", option.unit);
  return absl::StrCat(bound(option.minimum), " to ", bound(option.maximum), unit);
}

absl::StatusOr<OptionValue> ParseOptionText(const Option& option, const std::string& text, const std::string& prefix) {
  int64_t whole = 0;
  double real = 0;
  if (option.is_integer()) {
    if (!absl::SimpleAtoi(text, &whole)) return Refuse(option, text, prefix);
    return CheckOptionValue(option, whole, text, prefix);
  }
  if (!absl::SimpleAtod(text, &real)) return Refuse(option, text, prefix);
  return CheckOptionValue(option, real, text, prefix);
}

absl::StatusOr<OptionValue> CheckOptionValue(const Option& option, OptionValue value, const std::string& text,
                                             const std::string& prefix) {
  if (option.is_integer() && !std::holds_alternative<int64_t>(value)) return Refuse(option, text, prefix);
  if (!IsAllowed(option, value)) return Refuse(option, text, prefix);
  return option.is_integer() ? value : OptionValue(AsDouble(value));
}

absl::Status CheckOptions(const ReconstructionOptions& options, const std::string& prefix) {
  for (const Option& option : OptionTable()) {
    const OptionValue value = option.Get(options);
    MW_RETURN_IF_ERROR(CheckOptionValue(option, value, FormatValue(value), prefix).status());
  }
  for (const OptionRelation& relation : OptionRelations()) {
    const OptionValue smaller = FindOption(relation.smaller)->Get(options);
    const OptionValue larger = FindOption(relation.larger)->Get(options);
    const double least = relation.factor * AsDouble(smaller) + relation.offset;
    if (AsDouble(larger) >= least) continue;
    return absl::InvalidArgumentError(absl::StrCat(prefix, relation.larger, " is ", FormatValue(larger),
                                                   ", expected at least ",
                                                   DescribeLeast(relation, smaller, least, prefix)));
  }
  return absl::OkStatus();
}

}  // namespace meshwright
