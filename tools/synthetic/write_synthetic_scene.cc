// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <string>
#include <system_error>
#include <vector>

#include <absl/strings/str_format.h>

#include "tools/synthetic/synthetic_scene.h"

#include "common/base/status_macros.h"
#include "common/image/encode.h"
#include "common/mesh/ply.h"
#include "common/scene/formats/export_colmap.h"

namespace meshwright {
namespace {

absl::Status MakeFolder(const std::string& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (!error) return absl::OkStatus();
  return absl::ErrnoToStatus(error.value(), absl::StrFormat("cannot make the folder %s", folder));
}

}  // namespace

absl::Status WriteSyntheticScene(const SyntheticScene& scene, const std::string& folder, ThreadPool& pool) {
  MW_RETURN_IF_ERROR(MakeFolder(folder + "/images"));
  MW_RETURN_IF_ERROR(MakeFolder(folder + "/model"));
  std::vector<absl::Status> written(scene.images.size());
  pool.ParallelFor(static_cast<int64_t>(scene.images.size()), 1, [&](int64_t begin, int64_t end) {
    for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
      written[i] = WritePng(folder + "/images/" + scene.scene.views[i].name, scene.images[i]);
    }
  });
  for (const absl::Status& status : written) MW_RETURN_IF_ERROR(status);
  MW_RETURN_IF_ERROR(WritePly(scene.ground_truth, folder + "/ground_truth.ply"));
  return ExportColmapText(scene.scene, folder + "/model");
}

}  // namespace meshwright
