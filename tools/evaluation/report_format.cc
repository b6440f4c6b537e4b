// SPDX-License-Identifier: Apache-2.0
#include <string>

#include <absl/strings/str_format.h>
#include <nlohmann/json.hpp>

#include "tools/evaluation/evaluation.h"

namespace meshwright {
namespace {

nlohmann::ordered_json ByThreshold(const EvaluationReport::PerThreshold& shares) {
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  for (size_t k = 0; k < shares.size(); ++k) json[std::to_string(EvaluationReport::kThresholds[k])] = shares[k];
  return json;
}

std::string Row(const char* name, const EvaluationReport::PerThreshold& shares) {
  std::string row = absl::StrFormat("%-22s", name);
  for (const double share : shares) row += absl::StrFormat("  %6.4f", share);
  return row + "\n";
}

}  // namespace

nlohmann::ordered_json ToJson(const EvaluationReport& report) {
  return {{"recall", ByThreshold(report.recall)},
          {"precision", ByThreshold(report.precision)},
          {"f_score", ByThreshold(report.f_score)},
          {"depth", ByThreshold(report.depth)},
          {"missing", report.missing},
          {"median_accuracy_g", report.median_accuracy_g},
          {"median_normal_error_deg", report.median_normal_error_deg},
          {"normals_within_10_deg", report.normals_within_10_deg},
          {"normals_within_30_deg", report.normals_within_30_deg},
          {"roughness_deg", report.roughness_deg},
          {"ground_truth_roughness_deg", report.ground_truth_roughness_deg},
          {"accuracy_90", report.accuracy_90},
          {"completeness", report.completeness},
          {"completeness_distance", report.completeness_distance},
          {"median_footprint", report.median_footprint},
          {"ground_truth_pixels", report.ground_truth_pixels},
          {"recall_pixels", report.recall_pixels},
          {"precision_pixels", report.precision_pixels}};
}

std::string ToText(const EvaluationReport& report) {
  std::string text = absl::StrFormat("%-22s", "within k g, k =");
  for (const int k : EvaluationReport::kThresholds) text += absl::StrFormat("  %6d", k);
  text += "\n";
  text += Row("recall R", report.recall);
  text += Row("precision P", report.precision);
  text += Row("F-score F", report.f_score);
  text += Row("depth D", report.depth);
  text += absl::StrFormat("missing                 %6.4f of the ground-truth pixels\n", report.missing);
  text += absl::StrFormat("median accuracy         %6.4f g\n", report.median_accuracy_g);
  text += absl::StrFormat("normals                 off by %.1f degrees (median); %.4f within 10, %.4f within 30\n",
                          report.median_normal_error_deg, report.normals_within_10_deg, report.normals_within_30_deg);
  text += absl::StrFormat("roughness               %.1f degrees from pixel to pixel, of the ground truth %.1f\n",
                          report.roughness_deg, report.ground_truth_roughness_deg);
  text += absl::StrFormat("accuracy at 90 %%        %.6g scene units\n", report.accuracy_90);
  text += absl::StrFormat("completeness            %6.4f within %.6g scene units\n", report.completeness,
                          report.completeness_distance);
  text += absl::StrFormat("g (pixel footprint)     %.6g scene units (median)\n", report.median_footprint);
  return text;
}

}  // namespace meshwright
