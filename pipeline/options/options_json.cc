// SPDX-License-Identifier: Apache-2.0
#include "pipeline/options/options_json.h"

#include <cstdint>
#include <limits>

#include <absl/strings/str_cat.h>

#include "pipeline/options/option_table.h"
#include "pipeline/options/presets.h"

#include "common/base/method_version.h"
#include "common/base/status_macros.h"
#include "common/json/json_text.h"
#include "common/json/parse_json.h"

namespace meshwright {
namespace {

constexpr char kMethod[] = "method";
// What the programs before wrote instead of the method's version: their own, which was always this.
constexpr char kProgram[] = "version";
constexpr char kProgramOfFirstMethod[] = "0.1.0";

int64_t MethodOf(const nlohmann::ordered_json& json) {
  const auto method = json.find(kMethod);
  if (method == json.end()) return 1;
  return method->is_number_integer() ? method->get<int64_t>() : 0;
}

absl::Status Wrong(const std::string& message) {
  return absl::InvalidArgumentError(absl::StrCat("options_json: ", message));
}

// Whole numbers that int64_t cannot hold come as real ones, so that the range says no.
OptionValue NumberOf(const nlohmann::json& number) {
  constexpr auto kLargest = static_cast<uint64_t>(std::numeric_limits<int64_t>::max());
  const bool is_whole =
      number.is_number_integer() && !(number.is_number_unsigned() && number.get<uint64_t>() > kLargest);
  if (is_whole) return number.get<int64_t>();
  return number.get<double>();
}

absl::Status SetOption(const std::string& name, const nlohmann::json& json, ReconstructionOptions& options) {
  const Option* const option = FindOption(name);
  if (option == nullptr) return absl::InvalidArgumentError(DescribeUnknownOption(name, ""));
  const std::string text = JsonText(json);
  // What is no number is as wrong as one out of range, and answered alike.
  const OptionValue number = json.is_number() ? NumberOf(json) : std::numeric_limits<double>::quiet_NaN();
  MW_ASSIGN_OR_RETURN(const OptionValue value, CheckOptionValue(*option, number, text, ""));
  option->Set(options, value);
  return absl::OkStatus();
}

nlohmann::ordered_json ToJson(OptionValue value) {
  return std::visit([](auto number) { return nlohmann::ordered_json(number); }, value);
}

nlohmann::ordered_json BoundToJson(const Option& option, double bound) {
  return option.is_integer() ? nlohmann::ordered_json(static_cast<int64_t>(bound)) : nlohmann::ordered_json(bound);
}

}  // namespace

absl::StatusOr<ReconstructionOptions> ParseOptions(const std::string& options_json) {
  const absl::StatusOr<nlohmann::json> json = ParseJson(options_json.empty() ? "{}" : options_json);
  if (!json.ok()) return Wrong(absl::StrCat("the text ", std::string(json.status().message())));
  if (!json->is_object()) return Wrong("a JSON object expected");
  ReconstructionOptions options;
  if (const auto preset = json->find(kPreset); preset != json->end()) {
    const std::string name = preset->is_string() ? preset->get<std::string>() : JsonText(*preset);
    if (const absl::Status set = ApplyPreset(name, "", options); !set.ok()) return Wrong(std::string(set.message()));
  }
  for (const auto& [name, value] : json->items()) {
    if (name == kMethod || name == kProgram || name == kPreset) continue;
    if (const absl::Status set = SetOption(name, value, options); !set.ok()) return Wrong(std::string(set.message()));
  }
  const auto program = json->find(kProgram);
  if (program != json->end() && *program != kProgramOfFirstMethod) {
    return Wrong(absl::StrCat("version is ", JsonText(*program).substr(0, 40), ", expected none"));
  }
  const auto method = json->find(kMethod);
  const bool is_first = program != json->end() && kMethodVersion != 1;
  if (is_first || (method != json->end() && *method != kMethodVersion)) {
    return Wrong(absl::StrCat("method is ", method == json->end() ? "1" : JsonText(*method).substr(0, 40),
                              ", this program has version ", kMethodVersion, " of the method"));
  }
  if (const absl::Status checked = CheckOptions(options, ""); !checked.ok()) {
    return Wrong(std::string(checked.message()));
  }
  return options;
}

nlohmann::ordered_json ToJson(const ReconstructionOptions& options) {
  nlohmann::ordered_json json;
  json[kMethod] = kMethodVersion;
  for (const Option& option : OptionTable()) json[option.name] = ToJson(option.Get(options));
  return json;
}

std::string DescribeMethods(int64_t before, int64_t now) {
  return absl::StrCat("it was begun with version ", before, " of the method, this program has version ", now);
}

std::vector<std::string> DescribeDifferences(const nlohmann::ordered_json& before, const nlohmann::ordered_json& now) {
  std::vector<std::string> differences;
  if (MethodOf(before) != MethodOf(now)) {
    differences.push_back(DescribeMethods(MethodOf(before), MethodOf(now)));
  }
  for (const auto& [name, value] : now.items()) {
    if (name == kMethod) continue;
    const auto stored = before.find(name);
    if (stored != before.end() && *stored == value) continue;
    differences.push_back(absl::StrCat("--", name, " was ", stored == before.end() ? "not known" : JsonText(*stored),
                                       ", now ", JsonText(value)));
  }
  return differences;
}

std::string DescribeOptionsForRest() {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Option& option : OptionTable()) {
    list.push_back({{"name", option.name},
                    {"group", option.section},
                    {"type", option.is_integer() ? "integer" : "number"},
                    {"unit", option.unit},
                    {"default", ToJson(option.Default())},
                    {"minimum", BoundToJson(option, option.minimum)},
                    {"maximum", BoundToJson(option, option.maximum)},
                    {"documentation", option.help},
                    {"tradeOff", option.trade_off}});
  }
  nlohmann::ordered_json response;
  response["options"] = std::move(list);
  nlohmann::ordered_json presets = nlohmann::ordered_json::array();
  for (const Preset& preset : Presets()) {
    nlohmann::ordered_json values = nlohmann::ordered_json::object();
    for (const auto& [name, value] : preset.values) values[name] = ToJson(value);
    presets.push_back({{"name", preset.name}, {"documentation", preset.help}, {"values", std::move(values)}});
  }
  response["presets"] = std::move(presets);
  return JsonText(response);
}

}  // namespace meshwright
