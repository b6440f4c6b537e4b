// SPDX-License-Identifier: Apache-2.0
#include "worker/main/colmap_estimator.h"

#include <filesystem>
#include <utility>

#include <nlohmann/json.hpp>

#include "pipeline/cameras/estimate_cameras.h"

#include "common/base/clock.h"
#include "common/base/status_macros.h"
#include "common/scene/formats/import.h"

namespace meshwright {
namespace {

constexpr char kProgram[] = "colmap";

absl::StatusOr<CameraEstimator::Result> Estimate(const CameraEstimator::Job& job) {
  const CameraEstimationSettings settings = {.photographs = job.photographs,
                                             .scene_folder = job.scene,
                                             .program = kProgram,
                                             .threads = job.threads,
                                             .restart = true,
                                             .stop = job.stop};
  const RealClock clock;
  const auto progress = [&](const CameraProgress& made) { job.progress(NameOf(made.step), made.fraction); };
  MW_ASSIGN_OR_RETURN(const CameraEstimate estimate, EstimateCameras(settings, clock, progress));
  CameraEstimator::Result result;
  MW_ASSIGN_OR_RETURN(result.scene, ImportScene(job.scene));
  for (SceneView& view : result.scene.views) view.image_path = view.name;
  result.report_json = nlohmann::ordered_json{
      {"photographs", estimate.photographs},
      {"registered", estimate.registered},
      {"notes",
       estimate.notes}}.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
  return result;
}

}  // namespace

CameraEstimator MakeColmapEstimator(std::string* why_not) {
  absl::StatusOr<std::string> version = FindColmap(kProgram);
  if (version.ok()) return {.colmap_version = *std::move(version), .estimate = Estimate};
  *why_not = std::string(version.status().message());
  return {};
}

}  // namespace meshwright
