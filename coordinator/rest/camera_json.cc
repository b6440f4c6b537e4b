// SPDX-License-Identifier: Apache-2.0
#include "coordinator/rest/camera_json.h"

#include <algorithm>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>
#include <absl/time/time.h>

#include "common/base/clock.h"
#include "common/base/status_macros.h"
#include "common/json/parse_json.h"
#include "common/scene/scene.h"
#include "coordinator/rest/json.h"

namespace meshwright {
namespace {

using Json = nlohmann::ordered_json;

Json GeometryJson(const SceneView& view) {
  const auto& rotation = view.cam_from_world.rotation;
  const auto& translation = view.cam_from_world.translation;
  Json rows = Json::array();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) rows.push_back(rotation(row, column));
  }
  return {{"width", view.lens.width},    {"height", view.lens.height},
          {"fx", view.lens.fx},          {"fy", view.lens.fy},
          {"cx", view.lens.cx},          {"cy", view.lens.cy},
          {"rotation", std::move(rows)}, {"translation", {translation.x(), translation.y(), translation.z()}}};
}

// Reports come from workers: anything can be missing.
double NumberAt(const Json& report, const char* name) {
  const auto found = report.find(name);
  return found != report.end() && found->is_number() ? found->get<double>() : 0;
}

void AddReport(const v1::Camera& camera, Json& json) {
  const absl::StatusOr<Json> parsed = ParseJson<Json>(camera.report_json());
  if (!parsed.ok() || !parsed->is_object()) return;
  const Json& report = *parsed;
  const double rays = NumberAt(report, "rays");
  const auto share = [&](double part) { return rays > 0 ? part / rays : 0.0; };
  json["shares"] = {{"coveredBefore", share(NumberAt(report, "rays_covered_before"))},
                    {"grown", share(NumberAt(report, "rays_grown"))},
                    {"filtered", share(NumberAt(report, "rays_filtered"))},
                    {"accepted", share(static_cast<double>(camera.accepted_patches()))}};
  Json seconds = Json::object();
  const auto stages = report.find("seconds");
  if (stages != report.end() && stages->is_object()) {
    for (const auto& [stage, value] : stages->items()) {
      if (value.is_number()) seconds[stage] = value;
    }
  }
  json["seconds"] = std::move(seconds);
}

constexpr char kInfo[] = "info";
constexpr char kWarning[] = "warning";
constexpr char kError[] = "error";
constexpr ptrdiff_t kMaxLogEntries = 1000;
// The last ones that cameras are counted and failures looked for in.
constexpr int kAttemptsLookedAt = 20'000;

absl::StatusOr<v1::ListAttemptsResponse> LastAttempts(const ReconstructionService& service, const std::string& id) {
  v1::ListAttemptsRequest request;
  request.set_id(id);
  request.set_max_attempts(kAttemptsLookedAt);
  return service.ListAttempts(request);
}

struct LogEntry {
  absl::Time time;
  const char* severity = kInfo;
  std::string message;
  int32_t camera = -1;  // -1: about none
  std::string worker;   // "": about none
};

absl::Time TimeOf(const google::protobuf::Timestamp& timestamp) {
  return absl::FromUnixSeconds(timestamp.seconds()) + absl::Nanoseconds(timestamp.nanos());
}

Json EntryJson(const LogEntry& entry) {
  Json json = {{"time", absl::FormatTime("%Y-%m-%dT%H:%M:%E3SZ", entry.time, absl::UTCTimeZone())},
               {"severity", entry.severity},
               {"message", entry.message}};
  if (entry.camera >= 0) json["camera"] = entry.camera;
  if (!entry.worker.empty()) json["worker"] = entry.worker;
  return json;
}

// What went wrong; nothing for an attempt that did not.
std::optional<LogEntry> EntryOf(const v1::Attempt& attempt, const std::string& camera_name) {
  const char* what = nullptr;
  if (attempt.ending() == v1::ATTEMPT_ENDING_FAILED) what = " failed";
  if (attempt.ending() == v1::ATTEMPT_ENDING_OUT_OF_MEMORY) what = " ran out of memory";
  if (attempt.ending() == v1::ATTEMPT_ENDING_LOST) what = " was lost with its worker, and is done again";
  if (what == nullptr) return std::nullopt;
  std::string message = camera_name + what;
  if (!attempt.reason().empty()) message += ": " + attempt.reason();
  return LogEntry{TimeOf(attempt.end_time()), kWarning, std::move(message), attempt.camera(), attempt.worker()};
}

}  // namespace

absl::StatusOr<Json> CamerasJson(const ReconstructionService& service, const std::string& id) {
  MW_ASSIGN_OR_RETURN(const v1::ListCamerasResponse cameras, service.ListCameras(id));
  Json list = Json::array();
  if (cameras.cameras_size() > 0) {
    MW_ASSIGN_OR_RETURN(const Scene scene, service.LoadScene(id));
    MW_ASSIGN_OR_RETURN(const v1::ListAttemptsResponse attempts, LastAttempts(service, id));
    std::map<int32_t, int> count;
    std::map<int32_t, std::string> last_worker;
    for (const v1::Attempt& attempt : attempts.attempts()) {
      ++count[attempt.camera()];
      last_worker.try_emplace(attempt.camera(), attempt.worker());  // the last ones come first
    }
    for (const v1::Camera& camera : cameras.cameras()) {
      Json json = Json::parse(ToJson(camera), nullptr, false);
      json["attempts"] = count[camera.index()];
      json["worker"] = last_worker[camera.index()];
      const auto index = static_cast<size_t>(camera.index());
      if (index < scene.views.size()) json["geometry"] = GeometryJson(scene.views[index]);
      AddReport(camera, json);
      list.push_back(std::move(json));
    }
  }
  Json response;
  response["cameras"] = std::move(list);
  return response;
}

absl::StatusOr<Json> LogJson(const ReconstructionService& service, const std::string& id) {
  MW_ASSIGN_OR_RETURN(const v1::Reconstruction reconstruction, service.Get(id));
  MW_ASSIGN_OR_RETURN(const v1::ListCamerasResponse cameras, service.ListCameras(id));
  MW_ASSIGN_OR_RETURN(const v1::ListAttemptsResponse attempts, LastAttempts(service, id));
  std::vector<LogEntry> entries;
  entries.push_back({TimeOf(reconstruction.create_time()), kInfo, "created"});
  const absl::Time now = reconstruction.has_finish_time() ? TimeOf(reconstruction.finish_time()) : SystemClock().Now();
  std::map<int32_t, absl::Time> last_end;
  for (const v1::Attempt& attempt : attempts.attempts()) {
    if (!attempt.has_end_time()) continue;
    last_end.try_emplace(attempt.camera(), TimeOf(attempt.end_time()));
    const bool is_known = attempt.camera() >= 0 && attempt.camera() < cameras.cameras_size();
    auto entry = EntryOf(attempt, is_known                 ? cameras.cameras(attempt.camera()).name()
                                  : attempt.camera() == -1 ? "estimating the cameras"
                                                           : "a camera");
    if (entry) entries.push_back(*std::move(entry));
  }
  // Attempts come with the last ones first, and of the same moment the last one is to be told last.
  std::reverse(entries.begin() + 1, entries.end());
  for (const v1::Camera& camera : cameras.cameras()) {
    if (camera.state() != v1::CAMERA_STATE_SKIPPED) continue;
    const auto end = last_end.find(camera.index());
    entries.push_back({end != last_end.end() ? end->second : now, kError,
                       absl::StrCat(camera.name(), " was skipped: ", camera.skip_reason()), camera.index()});
  }
  if (reconstruction.has_finish_time()) {
    const bool failed = reconstruction.state() == v1::RECONSTRUCTION_STATE_FAILED;
    entries.push_back({now, failed ? kError : kInfo,
                       failed                                                    ? reconstruction.failure()
                       : reconstruction.state() == v1::RECONSTRUCTION_STATE_DONE ? "done"
                                                                                 : "cancelled"});
  }
  std::stable_sort(entries.begin(), entries.end(),
                   [](const LogEntry& a, const LogEntry& b) { return a.time < b.time; });
  if (static_cast<ptrdiff_t>(entries.size()) > kMaxLogEntries)
    entries.erase(entries.begin(), entries.end() - kMaxLogEntries);
  Json list = Json::array();
  for (const LogEntry& entry : entries) list.push_back(EntryJson(entry));
  Json response;
  response["entries"] = std::move(list);
  return response;
}

}  // namespace meshwright
