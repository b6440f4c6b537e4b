// SPDX-License-Identifier: Apache-2.0
#include "pipeline/report/stored_verdict.h"

#include <nlohmann/json.hpp>

#include "pipeline/report/cameras_report.h"
#include "pipeline/report/verdict.h"

#include "common/base/status_macros.h"
#include "common/json/json_text.h"
#include "common/scene/scene_codec.h"

namespace meshwright {

absl::StatusOr<std::string> MakeStoredVerdict(const std::string& id, const std::vector<JudgedCamera>& judged,
                                              JobStore& store, BlobStore& blobs) {
  MW_ASSIGN_OR_RETURN(const Reconstruction stored, store.GetReconstruction(id));
  MW_ASSIGN_OR_RETURN(const std::string bytes, blobs.Get(stored.scene_blob));
  MW_ASSIGN_OR_RETURN(const Scene scene, DecodeScene(bytes));
  ReportTotals totals;
  MW_ASSIGN_OR_RETURN(nlohmann::ordered_json report, MakeCamerasReport(scene, store, id, &totals));
  nlohmann::ordered_json verdict = MakeVerdict(judged, report["cameras"]);
  verdict["summary"] = DescribeVerdict(verdict);
  verdict["warning"] = DescribeWarning(verdict);
  return JsonText(verdict);
}

}  // namespace meshwright
