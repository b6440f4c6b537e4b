// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/strecha.h"

#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"
#include "common/scene/formats/calibration_matrix.h"

namespace meshwright {
namespace {

constexpr char kSuffix[] = ".camera";

absl::StatusOr<ImportedView> ReadCameraFile(const std::string& file, const std::string& image_name) {
  MW_ASSIGN_OR_RETURN(const std::string text, ReadTextFile(file));
  TextFields fields(text, {file, "line", 1});
  MW_ASSIGN_OR_RETURN(const Eigen::Matrix3d k, ReadMatrix(&fields, "K"));
  for (int i = 0; i < 3; ++i) {
    MW_ASSIGN_OR_RETURN(const double zero, fields.Number("row after K"));
    if (zero != 0) return FieldError(fields.place(), "row after K", absl::StrCat(zero), "0 0 0 (no distortion)");
  }
  MW_ASSIGN_OR_RETURN(const Eigen::Matrix3d r, ReadMatrix(&fields, "R"));
  Eigen::Vector3d center_in_world;
  for (double& component : center_in_world) {
    MW_ASSIGN_OR_RETURN(component, fields.Number("centre"));
  }
  constexpr int64_t kLargestSide = 1'000'000;  // px; CheckLens holds the product
  MW_ASSIGN_OR_RETURN(const int64_t width, fields.Integer("width", 1, kLargestSide));
  MW_ASSIGN_OR_RETURN(const int64_t height, fields.Integer("height", 1, kLargestSide));
  MW_RETURN_IF_ERROR(fields.ExpectEnd());

  const Place place{.file = file};
  ImportedView imported{.view = {.name = image_name}, .named_at = place};
  MW_ASSIGN_OR_RETURN(imported.view.lens, LensFromCalibrationMatrix(k, place));
  imported.view.lens.width = static_cast<int>(width);
  imported.view.lens.height = static_cast<int>(height);
  MW_RETURN_IF_ERROR(CheckLens(imported.view.lens, place));
  MW_ASSIGN_OR_RETURN(const Eigen::Matrix3d world_from_cam, NearestRotation(r, place));
  imported.view.cam_from_world.rotation = world_from_cam.transpose();
  imported.view.cam_from_world.translation = -(world_from_cam.transpose() * center_in_world);
  return imported;
}

}  // namespace

std::string FindStrechaCameras(const std::string& folder) {
  for (const char* below : {"cameras", "gt_dense_cameras", ""}) {
    std::string candidate = JoinPath(folder, below);
    if (!FilesEndingIn(candidate, kSuffix).empty()) return candidate;
  }
  return "";
}

absl::StatusOr<Scene> ImportStrecha(const std::string& folder, const ImportOptions& options) {
  const std::string cameras = FindStrechaCameras(folder);
  if (cameras.empty())
    return absl::NotFoundError(absl::StrCat(folder, ": no *.camera files here, in cameras/ or in gt_dense_cameras/"));
  std::vector<ImportedView> views;
  for (const std::string& name : FilesEndingIn(cameras, kSuffix)) {
    const std::string image_name = name.substr(0, name.size() - (sizeof(kSuffix) - 1));
    MW_ASSIGN_OR_RETURN(ImportedView view, ReadCameraFile(JoinPath(cameras, name), image_name));
    views.push_back(std::move(view));
  }
  return AssembleScene({.format = "strecha",
                        .file = cameras,
                        .views = std::move(views),
                        .points = {},
                        .image_folders = {JoinPath(folder, "images"), JoinPath(folder, ""), cameras}},
                       options);
}

}  // namespace meshwright
