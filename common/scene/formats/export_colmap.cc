// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/export_colmap.h"

#include <charconv>
#include <filesystem>
#include <vector>

#include <Eigen/Geometry>
#include <absl/strings/str_cat.h>

#include "common/base/files.h"
#include "common/base/status_macros.h"
#include "common/scene/formats/assemble.h"

namespace meshwright {
namespace {

// The shortest text that reads back as the same number.
void AppendNumber(double value, std::string* text) {
  char buffer[32];
  const std::to_chars_result result = std::to_chars(buffer, buffer + sizeof(buffer), value);
  text->push_back(' ');
  text->append(buffer, result.ptr);
}

struct ModelName {
  const char* name;
  bool single_focal;
  size_t coefficients;
};

ModelName NameOf(const Lens& lens) {
  switch (lens.model) {
    case Lens::Model::kPinhole:
      return {"PINHOLE", false, 0};
    case Lens::Model::kRadial:
      // Two focal lengths and a radial distortion: OPENCV without its tangential part.
      return lens.fx == lens.fy ? ModelName{"RADIAL", true, 2} : ModelName{"OPENCV", false, 4};
    case Lens::Model::kOpenCv:
      return {"OPENCV", false, 4};
    case Lens::Model::kFullOpenCv:
      return {"FULL_OPENCV", false, 8};
    case Lens::Model::kOpenCvFisheye:
      return {"OPENCV_FISHEYE", false, 4};
    case Lens::Model::kRadialFisheye:
      return lens.fx == lens.fy ? ModelName{"RADIAL_FISHEYE", true, 2} : ModelName{"OPENCV_FISHEYE", false, 4};
    case Lens::Model::kFov:
      return {"FOV", false, 1};
    case Lens::Model::kThinPrismFisheye:
      return {"THIN_PRISM_FISHEYE", false, 8};
    case Lens::Model::kBrown:  // with a factor of r^8; without one it is FULL_OPENCV
      return {nullptr, false, 0};
    case Lens::Model::kRadTanThinPrismFisheye:
      return {"RAD_TAN_THIN_PRISM_FISHEYE", false, 12};
    case Lens::Model::kDivision:
      return {"DIVISION", false, 1};
    case Lens::Model::kEucm:
      return {"EUCM", false, 2};
  }
  return {"PINHOLE", false, 0};
}

// A line of cameras.txt, without the id.
std::string CameraText(const Lens& lens) {
  const ModelName model = NameOf(lens);
  std::string text = absl::StrCat(model.name, " ", lens.width, " ", lens.height);
  AppendNumber(lens.fx, &text);
  if (!model.single_focal) AppendNumber(lens.fy, &text);
  AppendNumber(lens.cx, &text);
  AppendNumber(lens.cy, &text);
  for (size_t i = 0; i < model.coefficients; ++i) AppendNumber(lens.coefficients[i], &text);
  return text;
}

struct Observation {
  Eigen::Vector2d pixel;
  size_t point;
};

std::string ImageText(const SceneView& view, const Eigen::Vector3d& offset, size_t image_id, size_t camera_id,
                      const std::vector<Observation>& observations) {
  std::string text = absl::StrCat(image_id);
  const Eigen::Quaterniond q(view.cam_from_world.rotation);
  for (const double component : {q.w(), q.x(), q.y(), q.z()}) AppendNumber(component, &text);
  for (const double component : (view.cam_from_world.translation - view.cam_from_world.rotation * offset).eval()) {
    AppendNumber(component, &text);
  }
  absl::StrAppend(&text, " ", camera_id, " ", view.name, "\n");
  std::string points;
  for (const Observation& observation : observations) {
    AppendNumber(observation.pixel.x(), &points);
    AppendNumber(observation.pixel.y(), &points);
    absl::StrAppend(&points, " ", observation.point + 1);
  }
  return text + (points.empty() ? points : points.substr(1)) + "\n";
}

}  // namespace

absl::Status ExportColmapText(const Scene& scene, const std::string& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return absl::InternalError(absl::StrCat(folder, ": cannot create the folder: ", error.message()));

  std::vector<std::string> cameras;  // distinct lines; id = position + 1
  std::vector<size_t> camera_of_view;
  for (const SceneView& view : scene.views) {
    if (view.lens.skew != 0) {
      return absl::InvalidArgumentError(
          absl::StrCat(view.name, ": skew is ", view.lens.skew, " px; expected 0, COLMAP has no model with skew"));
    }
    if (NameOf(view.lens).name == nullptr) {
      return absl::InvalidArgumentError(
          absl::StrCat(view.name, ": its lens has a factor of r^8; expected none, COLMAP has no model with one"));
    }
    if (view.name.empty() || view.name.find_first_of("\r\n") != std::string::npos) {
      return absl::InvalidArgumentError(absl::StrCat("image name is ", Quoted(view.name), "; expected one line"));
    }
    const std::string text = CameraText(view.lens);
    size_t camera = 0;
    while (camera < cameras.size() && cameras[camera] != text) ++camera;
    if (camera == cameras.size()) cameras.push_back(text);
    camera_of_view.push_back(camera);
  }

  std::vector<std::vector<Observation>> observations(scene.views.size());
  std::string points_text = "# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n";
  for (size_t i = 0; i < scene.points.size(); ++i) {
    const SparsePoint& point = scene.points[i];
    absl::StrAppend(&points_text, i + 1);
    for (const double component : (point.x_in_world + scene.offset).eval()) AppendNumber(component, &points_text);
    for (const uint8_t sample : point.rgb) absl::StrAppend(&points_text, " ", sample);
    absl::StrAppend(&points_text, " 0");
    for (const CameraIndex camera : point.seen_by) {
      const SceneView& view = scene.views[static_cast<size_t>(camera)];
      std::vector<Observation>& list = observations[static_cast<size_t>(camera)];
      const Eigen::Vector3d x_in_cam = view.cam_from_world * point.x_in_world;
      absl::StrAppend(&points_text, " ", camera + 1, " ", list.size());
      list.push_back({view.lens.PixelFromPlane(x_in_cam.hnormalized()), i});
    }
    points_text += '\n';
  }

  std::string cameras_text = "# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n";
  for (size_t i = 0; i < cameras.size(); ++i) absl::StrAppend(&cameras_text, i + 1, " ", cameras[i], "\n");
  std::string images_text =
      "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME; then POINTS2D[] as (X, Y, POINT3D_ID)\n";
  for (size_t i = 0; i < scene.views.size(); ++i) {
    images_text += ImageText(scene.views[i], scene.offset, i + 1, camera_of_view[i] + 1, observations[i]);
  }
  MW_RETURN_IF_ERROR(WriteFileAtomically(JoinPath(folder, "cameras.txt"), cameras_text));
  MW_RETURN_IF_ERROR(WriteFileAtomically(JoinPath(folder, "images.txt"), images_text));
  return WriteFileAtomically(JoinPath(folder, "points3D.txt"), points_text);
}

}  // namespace meshwright
