// SPDX-License-Identifier: Apache-2.0
#include "coordinator/api/photograph_files.h"

#include <filesystem>
#include <system_error>

#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"

namespace meshwright {

absl::StatusOr<Scene> WithPhotographFiles(Scene scene, BlobStore& blobs, const std::string& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return absl::PermissionDeniedError(absl::StrCat(folder, ": cannot make the folder: ", error.message()));
  for (size_t i = 0; i < scene.views.size(); ++i) {
    SceneView& view = scene.views[i];
    const std::string path = absl::StrCat(folder, "/", i, std::filesystem::path(view.name).extension().string());
    MW_RETURN_IF_ERROR(blobs.GetFile(view.image_path, path));
    view.image_path = path;
    if (view.mask_path.empty()) continue;
    const std::string mask = absl::StrCat(folder, "/", i, ".mask");
    MW_RETURN_IF_ERROR(blobs.GetFile(view.mask_path, mask));
    view.mask_path = mask;
  }
  return scene;
}

}  // namespace meshwright
