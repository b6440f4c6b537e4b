// SPDX-License-Identifier: Apache-2.0
#include "pipeline/report/page_text.h"

#include <algorithm>
#include <cmath>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_replace.h>

#include "common/base/utf8.h"
#include "common/json/json_text.h"

namespace meshwright {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kMebibyte = 1 << 20;

}  // namespace

std::string EscapeHtml(const std::string& text) {
  return absl::StrReplaceAll(ToUtf8(text),
                             {{"&", "&amp;"}, {"<", "&lt;"}, {">", "&gt;"}, {"\"", "&quot;"}, {"'", "&#39;"}});
}

const Json& MemberOf(const Json& json, const char* name) {
  static const auto* const kNone = new Json(Json::object());
  if (!json.is_object()) return *kNone;
  const auto found = json.find(name);
  return found != json.end() && found->is_structured() ? *found : *kNone;
}

double NumberOf(const Json& json, const char* name) {
  if (!json.is_object()) return 0;
  const auto found = json.find(name);
  return found != json.end() && found->is_number() ? found->get<double>() : 0;
}

std::string TextOf(const Json& json, const char* name) {
  if (!json.is_object()) return "";
  const auto found = json.find(name);
  return found != json.end() && found->is_string() ? found->get<std::string>() : "";
}

std::string FormatWhole(double number) {
  std::string text = absl::StrFormat("%.0f", number);
  for (auto at = static_cast<int>(text.size()) - 3; at > (number < 0 ? 1 : 0); at -= 3) {
    text.insert(static_cast<size_t>(at), ",");
  }
  return text;
}

std::string CountOf(const Json& json, const char* name) {
  const bool is_there = json.is_object() && json.contains(name) && json[name].is_number();
  return is_there ? FormatWhole(NumberOf(json, name)) : "";
}

std::string SecondsOf(const Json& json, const char* name) {
  const double seconds = NumberOf(json, name);
  if (!(seconds > 0)) return "";
  const auto whole = static_cast<int64_t>(std::llround(seconds));
  if (whole < 60) return absl::StrFormat("%.1f s", seconds);
  if (whole < 3600) return absl::StrFormat("%d:%02d min", whole / 60, whole % 60);
  return absl::StrFormat("%d:%02d h", whole / 3600, whole / 60 % 60);
}

std::string BytesOf(const Json& json, const char* name) {
  const double mebibytes = NumberOf(json, name) / kMebibyte;
  if (!(mebibytes > 0)) return "";
  return mebibytes < 1024 ? absl::StrFormat("%.0f MiB", mebibytes) : absl::StrFormat("%.1f GiB", mebibytes / 1024);
}

std::string ValueText(const Json& value) { return value.is_string() ? value.get<std::string>() : JsonText(value); }

RayShares SharesOf(double covered_before, double grown, double accepted) {
  RayShares shares;
  const double all_grown = std::clamp(grown, 0.0, 1.0);
  shares.accepted = std::clamp(accepted, 0.0, all_grown);
  shares.unconfirmed = all_grown - shares.accepted;
  shares.covered = std::clamp(covered_before, 0.0, 1 - all_grown);
  shares.empty = 1 - all_grown - shares.covered;
  return shares;
}

std::string Bar(const RayShares& shares, const std::string& more_classes) {
  std::string bar = absl::StrCat("<div class=\"bar", more_classes, "\">");
  const auto piece = [&](const char* name, double share) {
    absl::StrAppendFormat(&bar, "<span class=\"%s\" style=\"width:%.2f%%\"></span>", name, 100 * share);
  };
  piece("covered", shares.covered);
  piece("accepted", shares.accepted);
  piece("unconfirmed", shares.unconfirmed);
  return bar + "</div>";
}

}  // namespace meshwright
