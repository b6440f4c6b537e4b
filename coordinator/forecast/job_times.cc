// SPDX-License-Identifier: Apache-2.0
#include "coordinator/forecast/job_times.h"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "common/json/parse_json.h"

namespace meshwright {
namespace {

constexpr double kMostSeconds = 1e7;

// 0 for what is no number that a time or a count can be.
double NumberAt(const nlohmann::json& json, const char* name, double most) {
  const auto found = json.find(name);
  if (found == json.end() || !found->is_number()) return 0;
  const auto number = found->get<double>();
  return number >= 0 ? std::min(number, most) : 0;
}

}  // namespace

JobTimes TimesOfReport(const std::string& report_json) {
  JobTimes times;
  const absl::StatusOr<nlohmann::json> report = ParseJson(report_json);
  if (!report.ok() || !report->is_object()) return times;
  times.rays_grown = static_cast<int64_t>(NumberAt(*report, "rays_grown", 1e12));
  const auto seconds = report->find("seconds");
  if (seconds == report->end() || !seconds->is_object()) return times;
  for (const char* const stage : {"loading", "visibility", "seeding"}) {
    times.preparing_seconds += NumberAt(*seconds, stage, kMostSeconds);
  }
  for (const char* const stage : {"growing", "filtering", "refinement"}) {
    times.growing_seconds += NumberAt(*seconds, stage, kMostSeconds);
  }
  return times;
}

}  // namespace meshwright
