// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/alicevision.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <tuple>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"
#include "common/scene/formats/assemble.h"
#include "common/scene/formats/json_node.h"
#include "common/scene/formats/lens_and_pose.h"

namespace meshwright {
namespace {

using Version = std::tuple<int64_t, int64_t, int64_t>;

absl::StatusOr<Version> ReadVersion(const JsonNode& root) {
  MW_ASSIGN_OR_RETURN(const JsonNode node, root.At("version"));
  MW_ASSIGN_OR_RETURN(const std::vector<double> numbers, node.Numbers(3));
  return Version(static_cast<int64_t>(numbers[0]), static_cast<int64_t>(numbers[1]), static_cast<int64_t>(numbers[2]));
}

absl::Status ReadFocals(const JsonNode& intrinsic, const Version& version, Lens* lens) {
  if (version < Version(1, 2, 2) && intrinsic.Has("pxFocalLength")) {
    MW_ASSIGN_OR_RETURN(const JsonNode node, intrinsic.At("pxFocalLength"));
    if (node.IsArray()) {
      MW_ASSIGN_OR_RETURN(const std::vector<double> both, node.Numbers(2));
      lens->fx = both[0];
      lens->fy = both[1];
    } else {
      MW_ASSIGN_OR_RETURN(lens->fx, node.Number());
      lens->fy = lens->fx;
    }
    return absl::OkStatus();
  }
  MW_ASSIGN_OR_RETURN(const double focal_mm, intrinsic.Number("focalLength"));
  MW_ASSIGN_OR_RETURN(const double sensor_mm, intrinsic.Number("sensorWidth"));
  MW_ASSIGN_OR_RETURN(const double ratio, intrinsic.NumberOr("pixelRatio", 1));
  if (!(sensor_mm > 0 && ratio > 0)) return intrinsic.Error("a positive sensorWidth and pixelRatio");
  const double focal = focal_mm / sensor_mm * lens->width;
  // What the ratio divides, and which focal length it is that is written, changed twice.
  lens->fx = version >= Version(1, 2, 11) ? focal / ratio : focal;
  lens->fy = version >= Version(1, 2, 11) ? focal : version >= Version(1, 2, 5) ? focal * ratio : focal / ratio;
  return absl::OkStatus();
}

absl::Status ReadDistortion(const JsonNode& intrinsic, Lens* lens) {
  MW_ASSIGN_OR_RETURN(std::string type, intrinsic.Text("type"));
  if (intrinsic.Has("distortionType")) {
    if (type != "pinhole") {
      MW_ASSIGN_OR_RETURN(const JsonNode node, intrinsic.At("type"));
      return node.Error("pinhole (panoramas have to be cut into pinhole views)");
    }
    MW_ASSIGN_OR_RETURN(type, intrinsic.Text("distortionType"));
  }
  if (intrinsic.Has("undistortionType")) {
    MW_ASSIGN_OR_RETURN(const JsonNode node, intrinsic.At("undistortionType"));
    MW_ASSIGN_OR_RETURN(const std::string undistortion, node.Text());
    if (undistortion != "none") return node.Error("none (export undistorted photographs)");
  }
  std::vector<double> c;
  if (intrinsic.Has("distortionParams")) {
    MW_ASSIGN_OR_RETURN(const JsonNode node, intrinsic.At("distortionParams"));
    if (node.IsArray()) {
      MW_ASSIGN_OR_RETURN(c, node.Numbers(node.size()));
    }
  }
  static const std::map<std::string, size_t> kCounts = {
      {"none", 0},    {"pinhole", 0}, {"radialk1", 1}, {"radial1", 1},  {"radialk3", 3},
      {"radial3", 3}, {"brown", 5},   {"fisheye", 4},  {"fisheye4", 4}, {"fisheye1", 1}};
  const auto count = kCounts.find(type);
  if (count == kCounts.end() || c.size() < count->second) {
    return FieldError(intrinsic.place(), "distortion", absl::StrCat(Quoted(type), " with ", c.size(), " parameters"),
                      "none, radialk1 (1), radialk3 (3), brown (5), fisheye4 (4) or fisheye1 (1)");
  }
  c.resize(std::max(c.size(), size_t{5}), 0);
  if (type == "fisheye" || type == "fisheye4") {
    lens->model = Lens::Model::kOpenCvFisheye;
    lens->coefficients = {c[0], c[1], c[2], c[3]};
  } else if (type == "fisheye1") {
    lens->model = Lens::Model::kFov;
    lens->coefficients = {c[0]};
  } else if (count->second > 0) {
    const bool brown = type == "brown";
    SetDistortion({.k1 = c[0],
                   .k2 = count->second > 1 ? c[1] : 0,
                   .k3 = count->second > 1 ? c[2] : 0,
                   .p1 = brown ? c[3] : 0,
                   .p2 = brown ? c[4] : 0},
                  lens);
  }
  return absl::OkStatus();
}

absl::StatusOr<Lens> ReadLens(const JsonNode& intrinsic, const Version& version) {
  Lens lens;
  MW_ASSIGN_OR_RETURN(lens.width, intrinsic.Side("width"));
  MW_ASSIGN_OR_RETURN(lens.height, intrinsic.Side("height"));
  MW_RETURN_IF_ERROR(ReadFocals(intrinsic, version, &lens));
  MW_ASSIGN_OR_RETURN(const JsonNode node, intrinsic.At("principalPoint"));
  MW_ASSIGN_OR_RETURN(const std::vector<double> point, node.Numbers(2));
  const bool is_offset = version >= Version(1, 2, 1);
  lens.cx = point[0] + (is_offset ? lens.width / 2.0 : 0);
  lens.cy = point[1] + (is_offset ? lens.height / 2.0 : 0);
  MW_RETURN_IF_ERROR(ReadDistortion(intrinsic, &lens));
  MW_RETURN_IF_ERROR(CheckLens(lens, intrinsic.place()));
  return lens;
}

// The rotation is written column by column: read row by row it is camera to world.
absl::StatusOr<Rigid3> ReadPose(const JsonNode& pose) {
  MW_ASSIGN_OR_RETURN(const JsonNode transform_holder, pose.At("pose"));
  MW_ASSIGN_OR_RETURN(const JsonNode transform, transform_holder.At("transform"));
  MW_ASSIGN_OR_RETURN(const JsonNode rotation_node, transform.At("rotation"));
  MW_ASSIGN_OR_RETURN(const Eigen::Matrix3d matrix, rotation_node.Matrix3());
  MW_ASSIGN_OR_RETURN(const Eigen::Matrix3d world_from_cam, NearestRotation(matrix, rotation_node.place()));
  MW_ASSIGN_OR_RETURN(const JsonNode center_node, transform.At("center"));
  MW_ASSIGN_OR_RETURN(const Eigen::Vector3d center_in_world, center_node.Vector3());
  return PoseFromCenter(world_from_cam.transpose(), center_in_world);
}

struct Tables {
  std::map<std::string, Lens> lenses;
  std::map<std::string, Rigid3> poses;
  std::map<std::string, CameraIndex> camera_of_view;
};

absl::Status ReadLensesAndPoses(const JsonNode& root, Tables* tables) {
  MW_ASSIGN_OR_RETURN(const Version version, ReadVersion(root));
  MW_ASSIGN_OR_RETURN(const std::vector<JsonNode> intrinsics, root.Elements("intrinsics"));
  for (const JsonNode& intrinsic : intrinsics) {
    MW_ASSIGN_OR_RETURN(const std::string id, intrinsic.Text("intrinsicId"));
    MW_ASSIGN_OR_RETURN(tables->lenses[id], ReadLens(intrinsic, version));
  }
  if (!root.Has("poses")) return absl::OkStatus();
  MW_ASSIGN_OR_RETURN(const std::vector<JsonNode> poses, root.Elements("poses"));
  for (const JsonNode& pose : poses) {
    MW_ASSIGN_OR_RETURN(const std::string id, pose.Text("poseId"));
    MW_ASSIGN_OR_RETURN(tables->poses[id], ReadPose(pose));
  }
  return absl::OkStatus();
}

absl::Status ReadViews(const JsonNode& root, Tables* tables, ImportedScene* scene) {
  MW_ASSIGN_OR_RETURN(const std::vector<JsonNode> views, root.Elements("views"));
  size_t without_pose = 0;
  for (const JsonNode& view : views) {
    MW_ASSIGN_OR_RETURN(const std::string id, view.Text("viewId"));
    std::string pose_id = id;
    if (view.Has("poseId")) {
      MW_ASSIGN_OR_RETURN(pose_id, view.Text("poseId"));
    }
    const auto pose = tables->poses.find(pose_id);
    if (pose == tables->poses.end()) {
      ++without_pose;
      continue;
    }
    MW_ASSIGN_OR_RETURN(const std::string intrinsic_id, view.Text("intrinsicId"));
    const auto lens = tables->lenses.find(intrinsic_id);
    if (lens == tables->lenses.end()) {
      MW_ASSIGN_OR_RETURN(const JsonNode node, view.At("intrinsicId"));
      return node.Error("the intrinsicId of one of the intrinsics");
    }
    MW_ASSIGN_OR_RETURN(const std::string path, view.Text("path"));
    tables->camera_of_view[id] = static_cast<CameraIndex>(scene->views.size());
    scene->views.push_back({.view = {.name = PortableImageName(path),
                                     .image_path = "",
                                     .lens = lens->second,
                                     .cam_from_world = pose->second},
                            .named_at = view.place()});
  }
  if (scene->views.empty()) {
    return absl::InvalidArgumentError(absl::StrCat(scene->file, ": no camera has a pose (", views.size(),
                                                   " views); expected the cameras.sfm of StructureFromMotion"));
  }
  if (without_pose > 0) {
    scene->warnings.push_back(absl::StrCat(without_pose, " of ", views.size(), " photographs have no pose"));
  }
  return absl::OkStatus();
}

absl::Status ReadStructure(const JsonNode& root, const Tables& tables, ImportedScene* scene) {
  if (!root.Has("structure")) return absl::OkStatus();
  MW_ASSIGN_OR_RETURN(const std::vector<JsonNode> landmarks, root.Elements("structure"));
  for (const JsonNode& landmark : landmarks) {
    SparsePoint point;
    MW_ASSIGN_OR_RETURN(const JsonNode x, landmark.At("X"));
    MW_ASSIGN_OR_RETURN(point.x_in_world, x.Vector3());
    if (landmark.Has("color")) {
      MW_ASSIGN_OR_RETURN(const JsonNode color_node, landmark.At("color"));
      MW_ASSIGN_OR_RETURN(point.rgb, color_node.Color());
    }
    MW_ASSIGN_OR_RETURN(const std::vector<JsonNode> observations, landmark.Elements("observations"));
    for (const JsonNode& observation : observations) {
      MW_ASSIGN_OR_RETURN(const std::string id, observation.Text("observationId"));
      const auto camera = tables.camera_of_view.find(id);
      if (camera != tables.camera_of_view.end()) point.seen_by.push_back(camera->second);
    }
    scene->points.push_back(std::move(point));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<Scene> ImportAliceVision(const std::string& file, const ImportOptions& options) {
  MW_ASSIGN_OR_RETURN(const JsonNode root, JsonNode::ReadFile(file));
  const std::string folder = std::filesystem::path(file).parent_path().string();
  ImportedScene scene{
      .format = "alicevision", .file = file, .image_folders = {JoinPath(folder, "images"), JoinPath(folder, "")}};
  Tables tables;
  MW_RETURN_IF_ERROR(ReadLensesAndPoses(root, &tables));
  MW_RETURN_IF_ERROR(ReadViews(root, &tables, &scene));
  MW_RETURN_IF_ERROR(ReadStructure(root, tables, &scene));
  return AssembleScene(std::move(scene), options);
}

}  // namespace meshwright
