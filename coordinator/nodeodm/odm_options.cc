// SPDX-License-Identifier: Apache-2.0
#include "coordinator/nodeodm/odm_options.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>

#include "common/base/check.h"
#include "common/json/json_text.h"
#include "common/json/parse_json.h"

namespace meshwright {
namespace {

constexpr size_t kMaxJsonBytes = size_t{1} << 20;
constexpr int kMaxDepth = 16;  // GeoJSON has some ten levels
constexpr size_t kQuoted = 64;
constexpr char kMaxImageSize[] = "max-image-size";

// pc-quality and feature-quality of ODM -> share of the photographs' size.
const std::map<std::string, double>& Qualities() {
  static const auto* const qualities = new std::map<std::string, double>{
      {"ultra", 1}, {"high", 0.5}, {"medium", 0.25}, {"low", 0.125}, {"lowest", 0.0625}};
  return *qualities;
}

bool IsQuality(const std::string& name) { return name == "pc-quality" || name == "feature-quality"; }

nlohmann::ordered_json Described(const std::string& name, const std::string& type, const std::string& value,
                                 const nlohmann::ordered_json& domain, const std::string& help) {
  return {{"name", name}, {"type", type}, {"value", value}, {"domain", domain}, {"help", help}};
}

std::string Number(const nlohmann::json& value) {
  return value.is_number_integer() ? absl::StrCat(value.get<int64_t>()) : absl::StrCat(value.get<double>());
}

bool IsInteger(const nlohmann::json& option) { return option.value("type", "") == "integer"; }

nlohmann::ordered_json DescribeOwn(const nlohmann::json& option) {
  const std::string type = IsInteger(option) ? "int" : "float";
  const std::string unit = option.value("unit", "");
  const std::string help =
      absl::StrCat(option.value("documentation", ""), unit.empty() ? "" : absl::StrCat(" (", unit, ")"));
  const std::string domain = absl::StrCat(IsInteger(option) ? "integer" : "float", ": ", Number(option["minimum"]),
                                          " <= x <= ", Number(option["maximum"]));
  return Described(option["name"], type, Number(option["default"]), domain, help);
}

// Clients send numbers as numbers or as text.
std::string TextOf(const nlohmann::json& value) {
  if (value.is_string()) return value.get<std::string>();
  return value.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string BadValue(const std::string& text, const std::string& expected) {
  return absl::StrCat("Invalid value ", text.substr(0, kQuoted), ", expected ", expected);
}

// The number that an option of ours gets, or what is wrong with it.
std::optional<nlohmann::json> OwnValue(const nlohmann::json& option, const std::string& text, std::string* error) {
  const auto least = option["minimum"].get<double>();
  const auto most = option["maximum"].get<double>();
  double value = 0;
  const bool good = absl::SimpleAtod(text, &value) && std::isfinite(value) && value >= least && value <= most &&
                    (!IsInteger(option) || value == std::floor(value));
  if (!good) {
    *error = BadValue(text, absl::StrCat(IsInteger(option) ? "a whole number " : "a number ", Number(option["minimum"]),
                                         "..", Number(option["maximum"])));
    return std::nullopt;
  }
  if (IsInteger(option)) return nlohmann::json(static_cast<int64_t>(value));
  return nlohmann::json(value);
}

}  // namespace

OdmOptions::OdmOptions(const std::string& own_options) {
  own_ = nlohmann::json::parse(own_options).at("options");
  auto all = nlohmann::ordered_json::array();
  auto qualities = nlohmann::ordered_json::array();
  for (const char* quality : {"ultra", "high", "medium", "low", "lowest"}) qualities.push_back(quality);
  all.push_back(
      Described("pc-quality", "enum", "ultra", qualities,
                "Size of the photographs that are used: ultra as they are, high half of it, medium a quarter, low an "
                "eighth, lowest a sixteenth. max-image-size overrides it"));
  all.push_back(
      Described("feature-quality", "enum", "ultra", qualities, "The same as pc-quality; the smaller of both is taken"));
  all.push_back(
      Described("skip-3dmodel", "bool", "false", "", "Leave out the textured model: surfaces and points alone"));
  for (const nlohmann::json& option : own_) all.push_back(DescribeOwn(option));
  description_ = JsonText(all);
}

absl::StatusOr<OdmTaskOptions> OdmOptions::Parse(const std::string& json) const {
  OdmTaskOptions options;
  if (json.empty()) return options;
  const auto parsed = ParseJson(json, {.max_bytes = kMaxJsonBytes, .max_depth = kMaxDepth});
  if (!parsed.ok()) return absl::InvalidArgumentError(absl::StrCat("options ", std::string(parsed.status().message())));
  if (!parsed->is_array())
    return absl::InvalidArgumentError("options is no array, expected [{\"name\", \"value\"}, ...]");
  auto errors = nlohmann::ordered_json::array();
  for (const nlohmann::json& item : *parsed) {
    if (!item.is_object() || !item.contains("name") || !item["name"].is_string() || !item.contains("value")) {
      return absl::InvalidArgumentError("options has something else than {\"name\", \"value\"}");
    }
    const std::string name = item["name"];
    const std::string text = TextOf(item["value"]);
    options.given.push_back({{"name", name}, {"value", item["value"]}});
    std::string error;
    const auto own = std::find_if(own_.begin(), own_.end(), [&](const nlohmann::json& o) { return o["name"] == name; });
    if (own != own_.end()) {
      if (const auto value = OwnValue(*own, text, &error)) options.own[name] = *value;
    } else if (IsQuality(name)) {
      const auto quality = Qualities().find(text);
      if (quality == Qualities().end()) {
        error = BadValue(text, "ultra, high, medium, low or lowest");
      } else {
        options.image_scale = std::min(options.image_scale, quality->second);
      }
    } else if (name == "skip-3dmodel") {
      if (text != "true" && text != "false") error = BadValue(text, "true or false");
      options.skips_model = text == "true";
    } else if (name != "name") {
      options.unused.push_back(name.substr(0, kQuoted));
    }
    if (!error.empty()) errors.push_back({{"name", name}, {"error", error}});
  }
  if (!errors.empty()) {
    return absl::InvalidArgumentError(errors.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
  }
  return options;
}

std::string OwnOptionsJson(const OdmTaskOptions& options, int longest_side_px) {
  nlohmann::json own = options.own;
  const bool is_scaled = options.image_scale < 1 && longest_side_px > 0;
  if (is_scaled && !own.contains(kMaxImageSize)) {
    own[kMaxImageSize] = std::max(1, static_cast<int>(std::lround(options.image_scale * longest_side_px)));
  }
  return JsonText(own);
}

}  // namespace meshwright
