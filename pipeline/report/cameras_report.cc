// SPDX-License-Identifier: Apache-2.0
#include "pipeline/report/cameras_report.h"

#include <vector>

#include "common/base/status_macros.h"
#include "common/json/parse_json.h"

namespace meshwright {
namespace {

using Json = nlohmann::ordered_json;

double Share(int64_t part, int64_t whole) {
  return whole > 0 ? static_cast<double>(part) / static_cast<double>(whole) : 0.0;
}

const std::string& NameOf(const Scene& scene, CameraIndex camera) {
  return scene.views[static_cast<size_t>(camera)].name;
}

int64_t IntegerAt(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_number_integer() ? found->get<int64_t>() : 0;
}

}  // namespace

absl::StatusOr<Json> MakeCamerasReport(const Scene& scene, JobStore& store, const std::string& reconstruction_id,
                                       ReportTotals* totals) {
  MW_ASSIGN_OR_RETURN(const std::vector<CameraJob> jobs, store.ListCameraJobs(reconstruction_id));
  MW_ASSIGN_OR_RETURN(const std::vector<Commit> commits, store.ListCommits(reconstruction_id));
  *totals = {};
  Json cameras = Json::array();
  for (size_t i = 0; i < commits.size() && i < jobs.size(); ++i) {
    const CameraJob& job = jobs[i];
    const Commit& commit = commits[i];
    Json entry;
    entry["sequence"] = commit.sequence;
    entry["camera"] = commit.camera;
    entry["name"] = NameOf(scene, commit.camera);
    entry["snapshot"] = job.snapshot;
    if (job.state == CameraJobState::kSkipped) {
      ++totals->cameras_skipped;
      entry["skipped"] = job.skip_reason;
      cameras.push_back(std::move(entry));
      continue;
    }
    const absl::StatusOr<Json> parsed = ParseJson<Json>(job.report_json);
    if (!parsed.ok() || !parsed->is_object()) {
      return absl::DataLossError("the store holds a report of a camera job that is not an object");
    }
    const Json& report = *parsed;
    // A worker says what its job came to, not which camera's it was.
    for (const auto& [key, value] : report.items()) {
      if (!entry.contains(key)) entry[key] = value;
    }
    Json weak = Json::array();
    for (const CameraIndex target : job.weak_targets) weak.push_back(NameOf(scene, target));
    entry["weak_targets"] = std::move(weak);
    entry["rays_accepted"] = commit.accepted_patches;
    const int64_t rays = IntegerAt(report, "rays");
    entry["shares"] = {{"covered_before", Share(IntegerAt(report, "rays_covered_before"), rays)},
                       {"grown", Share(IntegerAt(report, "rays_grown"), rays)},
                       {"filtered", Share(IntegerAt(report, "rays_filtered"), rays)},
                       {"accepted", Share(commit.accepted_patches, rays)}};
    cameras.push_back(std::move(entry));

    ++totals->cameras_processed;
    totals->rays += rays;
    totals->rays_covered_before += IntegerAt(report, "rays_covered_before");
    totals->rays_grown += IntegerAt(report, "rays_grown");
    totals->rays_filtered += IntegerAt(report, "rays_filtered");
    totals->rays_accepted += commit.accepted_patches;
    totals->seeds += IntegerAt(report, "seeds");
    totals->tentative_patches_scored += IntegerAt(report, "tentative_patches_scored");
  }
  Json json;
  json["totals"] = {{"cameras", scene.views.size()},
                    {"cameras_processed", totals->cameras_processed},
                    {"cameras_skipped", totals->cameras_skipped},
                    {"rays", totals->rays},
                    {"rays_covered_before", totals->rays_covered_before},
                    {"rays_grown", totals->rays_grown},
                    {"rays_filtered", totals->rays_filtered},
                    {"rays_accepted", totals->rays_accepted},
                    {"share_covered_before", Share(totals->rays_covered_before, totals->rays)},
                    {"share_grown", Share(totals->rays_grown, totals->rays)},
                    {"share_accepted", Share(totals->rays_accepted, totals->rays)},
                    {"seeds", totals->seeds},
                    {"tentative_patches_scored", totals->tentative_patches_scored}};
  json["cameras"] = std::move(cameras);
  return json;
}

}  // namespace meshwright
