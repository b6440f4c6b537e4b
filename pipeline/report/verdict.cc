// SPDX-License-Identifier: Apache-2.0
#include "pipeline/report/verdict.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <utility>

#include <absl/strings/str_format.h>

namespace meshwright {
namespace {

using Json = nlohmann::ordered_json;

double NumberAt(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_number() ? found->get<double>() : 0;
}

// Rays by what has become of them; all but `inferred` add up to `rays`.
struct Fates {
  double rays = 0;
  double covered = 0;
  double inferred = 0;  // of what is covered
  double blind = 0;
  double inconsistent = 0;
  double unsupported = 0;
  double contradicted = 0;

  void Add(const Fates& other) {
    rays += other.rays;
    covered += other.covered;
    inferred += other.inferred;
    blind += other.blind;
    inconsistent += other.inconsistent;
    unsupported += other.unsupported;
    contradicted += other.contradicted;
  }

  Json Shares() const {
    const double all = std::max(1.0, rays);
    return {
        {"coverage", covered / all},          {"inferred", inferred / all},       {"blind", blind / all},
        {"inconsistent", inconsistent / all}, {"unsupported", unsupported / all}, {"contradicted", contradicted / all}};
  }
};

// Some rays have both: surface that was there before, and a patch in front of it. What is covered comes first.
Fates FatesOf(const Json& camera, const JudgedCamera& judged) {
  Fates fates = {.rays = NumberAt(camera, "rays")};
  double left = fates.rays;
  const auto take = [&left](double count) {
    const double taken = std::clamp(count, 0.0, left);
    left -= taken;
    return taken;
  };
  fates.covered = take(NumberAt(camera, "rays_covered_before") + static_cast<double>(judged.kept));
  fates.inferred = std::min(fates.covered, static_cast<double>(judged.inferred));
  fates.unsupported = take(static_cast<double>(judged.unsupported));
  fates.contradicted = take(static_cast<double>(judged.contradicted));
  fates.inconsistent = take(NumberAt(camera, "rays_grown") - NumberAt(camera, "rays_filtered"));
  fates.blind = left;
  return fates;
}

// Root of the mean square; nothing when too little was measured to tell.
Json OffPx(double sum_of_squares, double measurements) {
  constexpr double kMinMeasurements = 50;
  if (measurements < kMinMeasurements) return nullptr;
  return std::sqrt(std::max(0.0, sum_of_squares / measurements));
}

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

Json MakeVerdict(const std::vector<JudgedCamera>& judged, Json& cameras) {
  std::map<CameraIndex, JudgedCamera> judged_of;
  for (const JudgedCamera& camera : judged) judged_of[camera.camera] = camera;
  Fates total;
  std::vector<double> off_px;
  Json least;
  for (Json& camera : cameras) {
    if (!camera.contains("rays")) continue;  // skipped
    const Fates fates = FatesOf(camera, judged_of[camera["camera"].get<CameraIndex>()]);
    total.Add(fates);
    Json shares = fates.Shares();
    if (least.is_null() || shares["coverage"] < least["coverage"]) {
      least = {{"name", camera["name"]}, {"coverage", shares["coverage"]}};
    }
    camera["fate"] = std::move(shares);
    Json off = OffPx(NumberAt(camera, "epipolar_squares"), NumberAt(camera, "epipolar_measurements"));
    if (!off.is_null()) off_px.push_back(off.get<double>());
    camera["off_px"] = std::move(off);
  }
  Json verdict = total.Shares();
  verdict["least_covered"] = std::move(least);
  verdict["cameras_off_px"] = off_px.empty() ? Json() : Json(Median(std::move(off_px)));
  return verdict;
}

std::string DescribeVerdict(const Json& verdict) {
  const auto percent = [&](const char* key) { return 100 * NumberAt(verdict, key); };
  std::string text = absl::StrFormat(
      "%.0f%% of the photographs covered (%.0f%% inferred), %.0f%% matched no other, %.0f%% inconsistent, %.0f%% "
      "confirmed by no other, "
      "%.0f%% contradicted",
      percent("coverage"), percent("inferred"), percent("blind"), percent("inconsistent"), percent("unsupported"),
      percent("contradicted"));
  const auto least = verdict.find("least_covered");
  if (least != verdict.end() && least->is_object()) {
    text += absl::StrFormat("; least covered: %s, %.0f%%", (*least)["name"].get<std::string>(),
                            100 * NumberAt(*least, "coverage"));
  }
  if (const double refined_px = NumberAt(verdict, "refined_px"); refined_px > 0) {
    text += absl::StrFormat("; the cameras were %.2f px off and are refined", refined_px);
  }
  return text;
}

std::string DescribeWarning(const Json& verdict) {
  const double off_px = NumberAt(verdict, "cameras_off_px");
  if (!(off_px > kCamerasOffPx)) return "";
  return absl::StrFormat("cameras seem at least %.1f px off: consider refining them", off_px);
}

}  // namespace meshwright
