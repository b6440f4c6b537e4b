// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/openmvg.h"

#include <filesystem>
#include <map>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"
#include "common/scene/formats/assemble.h"
#include "common/scene/formats/json_node.h"
#include "common/scene/formats/lens_and_pose.h"

namespace meshwright {
namespace {

constexpr int64_t kNone = 4294967295;  // for an id

absl::StatusOr<int64_t> ReadId(const JsonNode& node, const char* name) { return node.Integer(name, 0, kNone); }

// What stands in the two wrappers that cereal puts around pointers.
absl::StatusOr<JsonNode> Pointee(const JsonNode& holder) {
  MW_ASSIGN_OR_RETURN(const JsonNode value, holder.At("value"));
  MW_ASSIGN_OR_RETURN(const JsonNode wrapper, value.At("ptr_wrapper"));
  return wrapper.At("data");
}

// cereal writes the name of a type where it appears first, with an id of 2^31 more, and the id alone later.
class TypeNames {
 public:
  absl::StatusOr<std::string> Of(const JsonNode& holder) {
    constexpr int64_t kFirst = int64_t{1} << 31;
    MW_ASSIGN_OR_RETURN(const JsonNode value, holder.At("value"));
    MW_ASSIGN_OR_RETURN(const int64_t id, value.Integer("polymorphic_id", 0, kNone));
    if (value.Has("polymorphic_name")) {
      MW_ASSIGN_OR_RETURN(names_[id % kFirst], value.Text("polymorphic_name"));
    }
    const auto name = names_.find(id % kFirst);
    if (name == names_.end()) return value.Error("a polymorphic_id whose polymorphic_name was told before");
    return name->second;
  }

 private:
  std::map<int64_t, std::string> names_;
};

absl::Status ReadDistortion(const std::string& type, const JsonNode& data, Lens* lens) {
  const auto read = [&](const char* name, size_t count) -> absl::StatusOr<std::vector<double>> {
    MW_ASSIGN_OR_RETURN(const JsonNode node, data.At(name));
    return node.Numbers(count);
  };
  if (type == "pinhole") return absl::OkStatus();
  if (type == "pinhole_radial_k1") {
    MW_ASSIGN_OR_RETURN(const std::vector<double> c, read("disto_k1", 1));
    SetDistortion({.k1 = c[0]}, lens);
  } else if (type == "pinhole_radial_k3") {
    MW_ASSIGN_OR_RETURN(const std::vector<double> c, read("disto_k3", 3));
    SetDistortion({.k1 = c[0], .k2 = c[1], .k3 = c[2]}, lens);
  } else if (type == "pinhole_brown_t2") {
    MW_ASSIGN_OR_RETURN(const std::vector<double> c, read("disto_t2", 5));
    SetDistortion({.k1 = c[0], .k2 = c[1], .k3 = c[2], .p1 = c[3], .p2 = c[4]}, lens);
  } else if (type == "fisheye") {
    MW_ASSIGN_OR_RETURN(const std::vector<double> c, read("fisheye", 4));
    lens->model = Lens::Model::kOpenCvFisheye;
    lens->coefficients = {c[0], c[1], c[2], c[3]};
  } else {
    return FieldError(data.place(), "polymorphic_name", Quoted(type),
                      "pinhole, pinhole_radial_k1, pinhole_radial_k3, pinhole_brown_t2 or fisheye");
  }
  return absl::OkStatus();
}

absl::StatusOr<std::map<int64_t, Lens>> ReadLenses(const JsonNode& root) {
  MW_ASSIGN_OR_RETURN(const std::vector<JsonNode> intrinsics, root.Elements("intrinsics"));
  std::map<int64_t, Lens> lenses;
  TypeNames types;
  for (const JsonNode& intrinsic : intrinsics) {
    MW_ASSIGN_OR_RETURN(const int64_t id, ReadId(intrinsic, "key"));
    MW_ASSIGN_OR_RETURN(const std::string type, types.Of(intrinsic));
    MW_ASSIGN_OR_RETURN(const JsonNode data, Pointee(intrinsic));
    Lens lens;
    MW_ASSIGN_OR_RETURN(lens.width, data.Side("width"));
    MW_ASSIGN_OR_RETURN(lens.height, data.Side("height"));
    MW_ASSIGN_OR_RETURN(lens.fx, data.Number("focal_length"));
    lens.fy = lens.fx;
    MW_ASSIGN_OR_RETURN(const JsonNode point_node, data.At("principal_point"));
    MW_ASSIGN_OR_RETURN(const std::vector<double> point, point_node.Numbers(2));
    lens.cx = point[0] + 0.5;  // its pixel centres are integers
    lens.cy = point[1] + 0.5;
    MW_RETURN_IF_ERROR(ReadDistortion(type, data, &lens));
    MW_RETURN_IF_ERROR(CheckLens(lens, data.place()));
    lenses[id] = lens;
  }
  return lenses;
}

absl::StatusOr<std::map<int64_t, Rigid3>> ReadPoses(const JsonNode& root) {
  std::map<int64_t, Rigid3> poses;
  if (!root.Has("extrinsics")) return poses;
  MW_ASSIGN_OR_RETURN(const std::vector<JsonNode> extrinsics, root.Elements("extrinsics"));
  for (const JsonNode& extrinsic : extrinsics) {
    MW_ASSIGN_OR_RETURN(const int64_t id, ReadId(extrinsic, "key"));
    MW_ASSIGN_OR_RETURN(const JsonNode value, extrinsic.At("value"));
    MW_ASSIGN_OR_RETURN(const JsonNode rotation_node, value.At("rotation"));
    MW_ASSIGN_OR_RETURN(const Eigen::Matrix3d matrix, rotation_node.Matrix3());
    MW_ASSIGN_OR_RETURN(const Eigen::Matrix3d rotation, NearestRotation(matrix, rotation_node.place()));
    MW_ASSIGN_OR_RETURN(const JsonNode center_node, value.At("center"));
    MW_ASSIGN_OR_RETURN(const Eigen::Vector3d center_in_world, center_node.Vector3());
    poses[id] = PoseFromCenter(rotation, center_in_world);
  }
  return poses;
}

// Returns which camera each view became.
absl::StatusOr<std::map<int64_t, CameraIndex>> ReadViews(const JsonNode& root, ImportedScene* scene) {
  MW_ASSIGN_OR_RETURN(const auto lenses, ReadLenses(root));
  MW_ASSIGN_OR_RETURN(const auto poses, ReadPoses(root));
  MW_ASSIGN_OR_RETURN(const std::vector<JsonNode> views, root.Elements("views"));
  std::map<int64_t, CameraIndex> camera_of_view;
  for (const JsonNode& view : views) {
    MW_ASSIGN_OR_RETURN(const JsonNode data, Pointee(view));
    MW_ASSIGN_OR_RETURN(const int64_t pose_id, ReadId(data, "id_pose"));
    MW_ASSIGN_OR_RETURN(const int64_t lens_id, ReadId(data, "id_intrinsic"));
    const auto pose = poses.find(pose_id);
    const auto lens = lenses.find(lens_id);
    if (pose == poses.end() || lens == lenses.end()) continue;
    std::string path;
    if (data.Has("local_path")) {
      MW_ASSIGN_OR_RETURN(path, data.Text("local_path"));
    }
    MW_ASSIGN_OR_RETURN(const std::string filename, data.Text("filename"));
    MW_ASSIGN_OR_RETURN(const int64_t id, ReadId(data, "id_view"));
    camera_of_view[id] = static_cast<CameraIndex>(scene->views.size());
    scene->views.push_back({.view = {.name = PortableImageName(path.empty() ? filename : path + "/" + filename),
                                     .image_path = "",
                                     .lens = lens->second,
                                     .cam_from_world = pose->second},
                            .named_at = data.place()});
  }
  if (scene->views.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat(scene->file, ": no camera has a pose (", views.size(), " views, ", poses.size(),
                     " extrinsics); expected the sfm_data of the reconstruction's folder"));
  }
  if (scene->views.size() < views.size()) {
    scene->warnings.push_back(
        absl::StrCat(views.size() - scene->views.size(), " of ", views.size(), " photographs have no pose"));
  }
  return camera_of_view;
}

absl::Status ReadStructure(const JsonNode& root, const std::map<int64_t, CameraIndex>& camera_of_view,
                           std::vector<SparsePoint>* points) {
  if (!root.Has("structure")) return absl::OkStatus();
  MW_ASSIGN_OR_RETURN(const std::vector<JsonNode> landmarks, root.Elements("structure"));
  for (const JsonNode& landmark : landmarks) {
    MW_ASSIGN_OR_RETURN(const JsonNode value, landmark.At("value"));
    MW_ASSIGN_OR_RETURN(const JsonNode x, value.At("X"));
    SparsePoint point;
    MW_ASSIGN_OR_RETURN(point.x_in_world, x.Vector3());
    MW_ASSIGN_OR_RETURN(const std::vector<JsonNode> observations, value.Elements("observations"));
    for (const JsonNode& observation : observations) {
      MW_ASSIGN_OR_RETURN(const int64_t id, ReadId(observation, "key"));
      const auto camera = camera_of_view.find(id);
      if (camera != camera_of_view.end()) point.seen_by.push_back(camera->second);
    }
    points->push_back(std::move(point));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<Scene> ImportOpenMvg(const std::string& file, const ImportOptions& options) {
  MW_ASSIGN_OR_RETURN(const JsonNode root, JsonNode::ReadFile(file));
  const std::string folder = std::filesystem::path(file).parent_path().string();
  ImportedScene scene{
      .format = "openmvg", .file = file, .image_folders = {JoinPath(folder, "images"), JoinPath(folder, "")}};
  MW_ASSIGN_OR_RETURN(const auto camera_of_view, ReadViews(root, &scene));
  MW_RETURN_IF_ERROR(ReadStructure(root, camera_of_view, &scene.points));
  return AssembleScene(std::move(scene), options);
}

}  // namespace meshwright
