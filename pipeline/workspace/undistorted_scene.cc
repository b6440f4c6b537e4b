// SPDX-License-Identifier: Apache-2.0
#include "pipeline/workspace/undistorted_scene.h"

#include <filesystem>

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>

#include "common/base/files.h"
#include "common/base/status_macros.h"
#include "common/image/encode.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

constexpr int kJpegQuality = 97;

bool IsJpegName(const std::string& name) {
  const std::string ending = absl::AsciiStrToLower(fs::path(name).extension().string());
  return ending == ".jpg" || ending == ".jpeg";
}

bool IsPngName(const std::string& name) { return absl::AsciiStrToLower(fs::path(name).extension().string()) == ".png"; }

absl::Status MakeFolderOf(const fs::path& file) {
  std::error_code error;
  fs::create_directories(file.parent_path(), error);
  if (!error) return absl::OkStatus();
  return absl::PermissionDeniedError(
      absl::StrCat(file.parent_path().string(), ": cannot make the folder: ", error.message()));
}

}  // namespace

absl::StatusOr<Scene> WriteUndistortedScene(
    const Scene& scene, const WorkspaceSettings& settings, const WorkspaceProgress& progress,
    const std::function<absl::Status(const View& view, const std::string& name)>& use) {
  Scene undistorted = scene;
  for (size_t i = 0; i < scene.views.size(); ++i) {
    MW_ASSIGN_OR_RETURN(const View view, LoadView(scene.views[i], settings.max_image_size));
    SceneView& written = undistorted.views[i];
    if (!IsJpegName(written.name) && !IsPngName(written.name)) written.name += ".png";
    const fs::path path = fs::path(settings.folder) / "images" / written.name;
    MW_RETURN_IF_ERROR(MakeFolderOf(path));
    const bool is_jpeg = IsJpegName(written.name);
    const std::string bytes = is_jpeg ? EncodeJpeg(view.color, kJpegQuality) : EncodePng(view.color);
    MW_RETURN_IF_ERROR(WriteFileAtomically(path.string(), bytes));
    written.image_path = path.string();
    written.lens = {.width = view.camera.width,
                    .height = view.camera.height,
                    .fx = view.camera.fx,
                    .fy = view.camera.fy,
                    .cx = view.camera.cx,
                    .cy = view.camera.cy};
    MW_RETURN_IF_ERROR(use(view, written.name));
    progress(static_cast<int>(i) + 1, static_cast<int>(scene.views.size()));
  }
  return undistorted;
}

}  // namespace meshwright
