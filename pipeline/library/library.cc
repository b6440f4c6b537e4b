// SPDX-License-Identifier: Apache-2.0
#include "pipeline/library/library.h"

#include <algorithm>
#include <filesystem>
#include <thread>

#include <nlohmann/json.hpp>

#include "pipeline/local/local_reconstruction.h"
#include "pipeline/options/options_json.h"

#include "common/base/status_macros.h"
#include "worker/camera_job/camera_job.h"

namespace meshwright {
namespace {

absl::StatusOr<LocalSettings> SettingsOf(const ReconstructionRequest& request) {
  if (request.output_path.empty()) {
    return absl::InvalidArgumentError("output_path is empty, expected the name of a PLY file");
  }
  LocalSettings settings;
  settings.output_path = request.output_path;
  settings.report_path = request.report_path;
  if (settings.report_path.empty()) {
    settings.report_path = std::filesystem::path(request.output_path).replace_extension(".report.json").string();
  }
  settings.work_folder = request.work_folder.empty() ? request.output_path + ".work" : request.work_folder;
  settings.threads =
      request.threads > 0 ? request.threads : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  settings.memory_limit_bytes = request.memory_limit_bytes > 0
                                    ? request.memory_limit_bytes
                                    : std::max<int64_t>(1024, int64_t{512} * settings.threads) << 20;
  return settings;
}

}  // namespace

absl::StatusOr<ReconstructionSummary> Reconstruct(const Scene& scene, const ReconstructionRequest& request,
                                                  const ProgressListener& progress) {
  MW_ASSIGN_OR_RETURN(const ReconstructionOptions options, ParseOptions(request.options_json));
  MW_ASSIGN_OR_RETURN(const LocalSettings settings, SettingsOf(request));
  const CameraJobFunction job = [&](const CameraJobInput& input, ThreadPool& pool) {
    return RunCameraJob(input, options.job, pool);
  };
  const ProgressListener listener = progress ? progress : [](const LocalProgress&) {};
  MW_ASSIGN_OR_RETURN(const nlohmann::ordered_json report, ReconstructLocally(scene, options, settings, job, listener));
  ReconstructionSummary summary;
  summary.cameras_processed = report["totals"]["cameras_processed"].get<int>();
  summary.cameras_skipped = report["totals"]["cameras_skipped"].get<int>();
  summary.vertices = report["mesh"]["vertices"].get<int64_t>();
  summary.faces = report["mesh"]["faces"].get<int64_t>();
  return summary;
}

}  // namespace meshwright
