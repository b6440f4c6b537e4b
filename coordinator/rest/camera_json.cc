#include "coordinator/rest/camera_json.h"

#include <algorithm>
#include <vector>

#include <absl/strings/str_cat.h>
#include <absl/time/clock.h>
#include <absl/time/time.h>

#include "common/base/status_macros.h"
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
  const Json report = Json::parse(camera.report_json(), nullptr, false);
  if (!report.is_object()) return;
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

struct LogEntry {
  absl::Time time;
  const char* severity = kInfo;
  std::string message;
  int32_t camera = -1;  // -1: about none
};

absl::Time TimeOf(const google::protobuf::Timestamp& timestamp) {
  return absl::FromUnixSeconds(timestamp.seconds()) + absl::Nanoseconds(timestamp.nanos());
}

Json EntryJson(const LogEntry& entry) {
  Json json = {{"time", absl::FormatTime("%Y-%m-%dT%H:%M:%E3SZ", entry.time, absl::UTCTimeZone())},
               {"severity", entry.severity},
               {"message", entry.message}};
  if (entry.camera >= 0) json["camera"] = entry.camera;
  return json;
}

}  // namespace

absl::StatusOr<Json> CamerasJson(const ReconstructionLogic& logic, const std::string& id) {
  MW_ASSIGN_OR_RETURN(const v1::ListCamerasResponse cameras, logic.ListCameras(id));
  Json list = Json::array();
  if (cameras.cameras_size() > 0) {
    MW_ASSIGN_OR_RETURN(const Scene scene, logic.LoadScene(id));
    for (const v1::Camera& camera : cameras.cameras()) {
      Json json = Json::parse(ToJson(camera), nullptr, false);
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

absl::StatusOr<Json> LogJson(const ReconstructionLogic& logic, const std::string& id) {
  MW_ASSIGN_OR_RETURN(const v1::Reconstruction reconstruction, logic.Get(id));
  MW_ASSIGN_OR_RETURN(const v1::ListCamerasResponse cameras, logic.ListCameras(id));
  std::vector<LogEntry> entries;
  entries.push_back({TimeOf(reconstruction.create_time()), kInfo, "created"});
  const absl::Time now = reconstruction.has_finish_time() ? TimeOf(reconstruction.finish_time()) : absl::Now();
  for (const v1::Camera& camera : cameras.cameras()) {
    if (camera.state() != v1::CAMERA_STATE_SET_ASIDE) continue;
    entries.push_back(
        {now, kWarning, absl::StrCat(camera.name(), " was set aside: ", camera.set_aside_reason()), camera.index()});
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
