// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <nlohmann/json.hpp>

namespace meshwright {

// Values of a report as text of a page. Reports come from workers and from earlier programs: anything can be missing,
// or be of another type.
std::string EscapeHtml(const std::string& text);
// An empty object where there is none.
const nlohmann::ordered_json& MemberOf(const nlohmann::ordered_json& json, const char* name);
double NumberOf(const nlohmann::ordered_json& json, const char* name);     // 0 where there is none
std::string TextOf(const nlohmann::ordered_json& json, const char* name);  // "" where there is none
// "" where there is none.
std::string CountOf(const nlohmann::ordered_json& json, const char* name);    // "1,234"
std::string SecondsOf(const nlohmann::ordered_json& json, const char* name);  // "3:20"
std::string BytesOf(const nlohmann::ordered_json& json, const char* name);    // "512 MiB"
std::string FormatWhole(double number);
std::string ValueText(const nlohmann::ordered_json& value);

// What became of rays; they add up to 1.
struct RayShares {
  double covered = 0;
  double accepted = 0;
  double unconfirmed = 0;
  double empty = 1;
};
// From the shares of a report. A ray that was covered and has got a nearer patch counts as the latter.
RayShares SharesOf(double covered_before, double grown, double accepted);
std::string Bar(const RayShares& shares, const std::string& more_classes);

}  // namespace meshwright
