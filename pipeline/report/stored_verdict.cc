// SPDX-License-Identifier: Apache-2.0
#include "pipeline/report/stored_verdict.h"

#include <nlohmann/json.hpp>

#include "pipeline/report/cameras_report.h"
#include "pipeline/report/verdict.h"

#include "common/base/status_macros.h"
#include "common/json/json_text.h"
#include "common/json/parse_json.h"
#include "common/scene/scene_codec.h"

namespace meshwright {
namespace {

// What the job that refined the cameras says; where it could not there is nothing.
void AddRefinement(const std::string& report_json, nlohmann::ordered_json& verdict) {
  const auto report = ParseJson<nlohmann::ordered_json>(report_json);
  if (!report.ok() || !report->is_object()) return;
  const auto off_px = report->find("off_px");
  if (off_px != report->end() && off_px->is_number()) verdict["refined_px"] = *off_px;
}

}  // namespace

absl::StatusOr<std::string> MakeStoredVerdict(const std::string& id, const std::vector<JudgedCamera>& judged,
                                              JobStore& store, BlobStore& blobs) {
  MW_ASSIGN_OR_RETURN(const Reconstruction stored, store.GetReconstruction(id));
  MW_ASSIGN_OR_RETURN(const std::string bytes, blobs.Get(stored.scene_blob));
  MW_ASSIGN_OR_RETURN(const Scene scene, DecodeScene(bytes));
  ReportTotals totals;
  MW_ASSIGN_OR_RETURN(nlohmann::ordered_json report, MakeCamerasReport(scene, store, id, &totals));
  nlohmann::ordered_json verdict = MakeVerdict(judged, report["cameras"]);
  if (const absl::StatusOr<CameraJob> refinement = store.GetCameraJob(id, kCameraRefinement); refinement.ok()) {
    AddRefinement(refinement->report_json, verdict);
  }
  verdict["summary"] = DescribeVerdict(verdict);
  verdict["warning"] = DescribeWarning(verdict);
  return JsonText(verdict);
}

}  // namespace meshwright
