// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/transforms_json.h"

#include <cmath>
#include <filesystem>
#include <utility>
#include <vector>

#include <Eigen/LU>
#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"
#include "common/scene/formats/assemble.h"
#include "common/scene/formats/json_node.h"
#include "common/scene/formats/lens_and_pose.h"

namespace meshwright {
namespace {

using Matrix4 = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;

// What a frame says itself counts before what is said for all.
class Settings {
 public:
  Settings(const JsonNode& frame, const JsonNode& all) : frame_(frame), all_(all) {}

  bool Has(const std::string& name) const { return frame_.Has(name) || all_.Has(name); }
  const JsonNode& Holder(const std::string& name) const { return frame_.Has(name) ? frame_ : all_; }
  absl::StatusOr<double> NumberOr(const std::string& name, double otherwise) const {
    return Holder(name).NumberOr(name, otherwise);
  }

 private:
  const JsonNode& frame_;
  const JsonNode& all_;
};

constexpr double kRadiansPerDegree = M_PI / 180;

// A focal length from whichever of its forms is there; 0 for none. `size`: the picture's side in its direction, px.
absl::StatusOr<double> ReadFocal(const Settings& settings, const std::string& axis, double size) {
  if (settings.Has("fl_" + axis)) return settings.NumberOr("fl_" + axis, 0);
  MW_ASSIGN_OR_RETURN(const double radians, settings.NumberOr("camera_angle_" + axis, 0));
  MW_ASSIGN_OR_RETURN(const double degrees, settings.NumberOr(axis + "_fov", 0));
  const double angle = radians != 0 ? radians : degrees * kRadiansPerDegree;
  return angle == 0 ? 0 : size / (2 * std::tan(angle / 2));
}

absl::Status ReadDistortion(const Settings& settings, Lens* lens) {
  std::string model = "OPENCV";
  if (settings.Has("camera_model")) {
    MW_ASSIGN_OR_RETURN(model, settings.Holder("camera_model").Text("camera_model"));
  }
  if (settings.Has("is_fisheye")) {
    MW_ASSIGN_OR_RETURN(const JsonNode node, settings.Holder("is_fisheye").At("is_fisheye"));
    if (node.IsTrue()) model = "OPENCV_FISHEYE";
  }
  std::vector<double> c;  // k1 k2 k3 k4 p1 p2
  if (settings.Has("distortion_params")) {
    MW_ASSIGN_OR_RETURN(const JsonNode node, settings.Holder("distortion_params").At("distortion_params"));
    MW_ASSIGN_OR_RETURN(c, node.Numbers(model == "FISHEYE624" ? 12 : 6));
  } else {
    for (const char* name : {"k1", "k2", "k3", "k4", "p1", "p2"}) {
      MW_ASSIGN_OR_RETURN(c.emplace_back(), settings.NumberOr(name, 0));
    }
  }
  if (model == "OPENCV" || model == "PINHOLE" || model == "SIMPLE_PINHOLE" || model == "SIMPLE_RADIAL" ||
      model == "RADIAL" || model == "perspective") {
    SetDistortion({.k1 = c[0], .k2 = c[1], .k3 = c[2], .k4 = c[3], .p1 = c[4], .p2 = c[5]}, lens);
  } else if (model == "OPENCV_FISHEYE") {
    lens->model = Lens::Model::kOpenCvFisheye;
    lens->coefficients = {c[0], c[1], c[2], c[3]};
  } else if (model == "FISHEYE624" && c.size() == 12) {
    lens->model = Lens::Model::kRadTanThinPrismFisheye;
    std::copy(c.begin(), c.end(), lens->coefficients.begin());
  } else {
    MW_ASSIGN_OR_RETURN(const JsonNode node, settings.Holder("camera_model").At("camera_model"));
    return node.Error(
        "OPENCV, PINHOLE, SIMPLE_PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV_FISHEYE or FISHEYE624 (panoramas have to be "
        "cut into pinhole views)");
  }
  return absl::OkStatus();
}

// `width`, `height`: the picture's, px.
absl::StatusOr<Lens> ReadLens(const JsonNode& frame, const JsonNode& root, int width, int height) {
  const Settings settings(frame, root);
  Lens lens{.width = width, .height = height};
  MW_ASSIGN_OR_RETURN(lens.fx, ReadFocal(settings, "x", lens.width));
  MW_ASSIGN_OR_RETURN(lens.fy, ReadFocal(settings, "y", lens.height));
  if (lens.fx == 0 && lens.fy == 0) {
    return FieldError(frame.place(), "fl_x", "missing", "it, fl_y, camera_angle_x, camera_angle_y, x_fov or y_fov");
  }
  if (lens.fx == 0) lens.fx = lens.fy;
  if (lens.fy == 0) lens.fy = lens.fx;
  MW_ASSIGN_OR_RETURN(lens.cx, settings.NumberOr("cx", lens.width / 2.0));
  MW_ASSIGN_OR_RETURN(lens.cy, settings.NumberOr("cy", lens.height / 2.0));
  MW_RETURN_IF_ERROR(ReadDistortion(settings, &lens));
  MW_RETURN_IF_ERROR(CheckLens(lens, frame.place()));
  return lens;
}

// A matrix of three or four rows.
absl::StatusOr<Matrix4> ReadTransform(const JsonNode& node) {
  const size_t count = node.IsArray() && (node.size() == 4 || node.size() == 16) ? 16 : 12;
  MW_ASSIGN_OR_RETURN(const std::vector<double> numbers, node.Numbers(count));
  Matrix4 matrix = Matrix4::Identity();
  std::copy(numbers.begin(), numbers.end(), matrix.data());
  if (matrix.row(3) != Eigen::RowVector4d(0, 0, 0, 1)) return node.Error("a last row of 0 0 0 1");
  return matrix;
}

// original = original_from_saved * saved.
struct World {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  double scale = 1;
};

absl::StatusOr<World> ReadWorld(const JsonNode& root) {
  World world;
  if (root.Has("applied_transform")) {
    MW_ASSIGN_OR_RETURN(const JsonNode node, root.At("applied_transform"));
    MW_ASSIGN_OR_RETURN(const Matrix4 applied, ReadTransform(node));
    MW_ASSIGN_OR_RETURN(const Eigen::Matrix3d rotation, NearestRotation(applied.topLeftCorner<3, 3>(), node.place()));
    world.rotation = rotation.transpose();
    world.translation = -(rotation.transpose() * applied.topRightCorner<3, 1>());
  }
  MW_ASSIGN_OR_RETURN(world.scale, root.NumberOr("applied_scale", 1));
  if (!(world.scale > 0)) return FieldError(root.place(), "applied_scale", absl::StrCat(world.scale), "more than 0");
  return world;
}

absl::StatusOr<Rigid3> ReadPose(const JsonNode& frame, const World& world) {
  MW_ASSIGN_OR_RETURN(const JsonNode node,
                      frame.At(frame.Has("transform_matrix") ? "transform_matrix" : "transform_matrix_start"));
  MW_ASSIGN_OR_RETURN(const Matrix4 saved_from_cam, ReadTransform(node));
  MW_ASSIGN_OR_RETURN(const Eigen::Matrix3d rotation,
                      NearestRotation(saved_from_cam.topLeftCorner<3, 3>(), node.place()));
  // Saved: world = scale * (applied * original).
  const Eigen::Vector3d center =
      world.rotation * (saved_from_cam.topRightCorner<3, 1>() / world.scale) + world.translation;
  return PoseFromCenter(FlipYAndZ((world.rotation * rotation).transpose()), center);
}

// All files of one of Blender's sets.
std::vector<std::string> FilesOfSet(const std::string& file) {
  std::vector<std::string> files = {file};
  if (std::filesystem::path(file).filename() != "transforms_train.json") return files;
  for (const char* other : {"transforms_test.json", "transforms_val.json"}) {
    std::string path = (std::filesystem::path(file).parent_path() / other).string();
    if (IsFile(path)) files.push_back(std::move(path));
  }
  return files;
}

absl::Status ReadFrames(const std::string& file, ImportedScene* scene) {
  MW_ASSIGN_OR_RETURN(const JsonNode root, JsonNode::ReadFile(file));
  if (!root.Has("frames")) return FieldError(root.place(), "frames", "missing", "the cameras of a transforms.json");
  MW_ASSIGN_OR_RETURN(const World world, ReadWorld(root));
  MW_ASSIGN_OR_RETURN(const std::vector<JsonNode> frames, root.Elements("frames"));
  for (const JsonNode& frame : frames) {
    ImportedView imported{.view = {}, .named_at = frame.place()};
    MW_ASSIGN_OR_RETURN(const std::string path, frame.Text("file_path"));
    imported.view.name = PortableImageName(path);
    const Settings settings(frame, root);
    if (settings.Has("w") && settings.Has("h")) {
      MW_ASSIGN_OR_RETURN(const int width, settings.Holder("w").Side("w"));
      MW_ASSIGN_OR_RETURN(const int height, settings.Holder("h").Side("h"));
      MW_ASSIGN_OR_RETURN(imported.view.lens, ReadLens(frame, root, width, height));
    } else {
      imported.lens_of_size = [frame, root](int width, int height) { return ReadLens(frame, root, width, height); };
    }
    MW_ASSIGN_OR_RETURN(imported.view.cam_from_world, ReadPose(frame, world));
    scene->views.push_back(std::move(imported));
  }
  return absl::OkStatus();
}

}  // namespace

std::string FindTransformsJson(const std::string& folder) {
  for (const char* name : {"transforms.json", "transforms_train.json"}) {
    std::string file = JoinPath(folder, name);
    if (IsFile(file)) return file;
  }
  return "";
}

absl::StatusOr<Scene> ImportTransformsJson(const std::string& file, const ImportOptions& options) {
  const std::string folder = std::filesystem::path(file).parent_path().string();
  ImportedScene scene{
      .format = "transforms-json", .file = file, .image_folders = {JoinPath(folder, ""), JoinPath(folder, "images")}};
  for (const std::string& part : FilesOfSet(file)) MW_RETURN_IF_ERROR(ReadFrames(part, &scene));
  return AssembleScene(std::move(scene), options);
}

}  // namespace meshwright
