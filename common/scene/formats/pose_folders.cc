// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/pose_folders.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"
#include "common/scene/formats/assemble.h"
#include "common/scene/formats/lens_and_pose.h"
#include "common/scene/formats/text_fields.h"

namespace meshwright {
namespace {

constexpr char kPoseSuffix[] = ".pose.txt";
constexpr char kColorSuffix[] = ".color.png";

// The same for all photographs: the size is left open.
absl::StatusOr<Lens> LensOf(const std::string& folder, const ImportOptions& options) {
  if (!options.intrinsics.has_value()) {
    return absl::InvalidArgumentError(
        absl::StrCat(folder, ": the format has poses without intrinsics; expected --intrinsics FX,FY,CX,CY, in px"));
  }
  const auto& [fx, fy, cx, cy] = *options.intrinsics;
  return Lens{.fx = fx, .fy = fy, .cx = cx, .cy = cy};
}

// False where a number is not finite, which stands for a lost camera.
absl::StatusOr<bool> ReadMatrix4(TextFields* fields, Eigen::Matrix4d* matrix) {
  bool finite = true;
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) {
      MW_ASSIGN_OR_RETURN((*matrix)(row, column), fields->NumberOrNone("matrix"));
      finite = finite && std::isfinite((*matrix)(row, column));
    }
  }
  return finite;
}

absl::StatusOr<Rigid3> PoseOf(const Eigen::Matrix4d& world_from_cam, const Place& place) {
  if (world_from_cam.row(3) != Eigen::RowVector4d(0, 0, 0, 1)) {
    return FieldError(place, "last row of the matrix", absl::StrCat(world_from_cam(3, 0), " ", world_from_cam(3, 3)),
                      "0 0 0 1");
  }
  MW_ASSIGN_OR_RETURN(const Eigen::Matrix3d rotation, NearestRotation(world_from_cam.topLeftCorner<3, 3>(), place));
  return PoseFromCenter(rotation.transpose(), world_from_cam.topRightCorner<3, 1>());
}

absl::StatusOr<Scene> Finish(ImportedScene scene, size_t without_pose, const ImportOptions& options) {
  if (without_pose > 0) scene.warnings.push_back(absl::StrCat(without_pose, " photographs have no pose"));
  scene.warnings.push_back("no sparse points, which the format does not have; results are better with");
  return AssembleScene(std::move(scene), options);
}

// tx ty tz qx qy qz qw by time, in seconds.
absl::StatusOr<std::map<double, Rigid3>> ReadTrajectory(const std::string& file) {
  MW_ASSIGN_OR_RETURN(const std::string text, ReadTextFile(file));
  std::map<double, Rigid3> poses;
  TextLines lines(text);
  std::string_view line;
  while (lines.NextContent(&line)) {
    const Place place{.file = file, .number = lines.number()};
    TextFields fields(line, place);
    MW_ASSIGN_OR_RETURN(const double time, fields.Number("time"));
    Eigen::Vector3d center;
    for (double& component : center) {
      MW_ASSIGN_OR_RETURN(component, fields.Number("position"));
    }
    Eigen::Vector4d q;  // x y z w
    for (double& component : q) {
      MW_ASSIGN_OR_RETURN(component, fields.Number("quaternion"));
    }
    MW_RETURN_IF_ERROR(fields.ExpectEnd());
    const double length = q.norm();
    if (!(length > 0)) return FieldError(place, "length of the quaternion", absl::StrCat(length), "1");
    q /= length;
    MW_ASSIGN_OR_RETURN(const Eigen::Matrix3d world_from_cam, RotationFromQuaternion(q[3], q[0], q[1], q[2], place));
    poses[time] = PoseFromCenter(world_from_cam.transpose(), center);
  }
  return poses;
}

// Null when none is near enough.
const Rigid3* NearestPose(const std::map<double, Rigid3>& poses, double time) {
  constexpr double kFurthest = 0.02;  // s
  const auto after = poses.lower_bound(time);
  const Rigid3* nearest = nullptr;
  double distance = kFurthest;
  if (after != poses.end() && after->first - time <= distance) {
    nearest = &after->second;
    distance = after->first - time;
  }
  if (after != poses.begin() && time - std::prev(after)->first <= distance) nearest = &std::prev(after)->second;
  return nearest;
}

// Names of the photographs in a folder, sorted.
std::vector<std::string> PicturesIn(const std::string& folder) {
  std::vector<std::string> names = FilesEndingIn(folder, "");
  std::erase_if(names, [](const std::string& name) {
    const std::string ending = LowerCaseEnding(name);
    const std::string stem = std::filesystem::path(name).stem().string();
    const bool is_mask = stem.ends_with("_mask") || stem.ends_with(".mask");
    return is_mask || (ending != ".jpg" && ending != ".jpeg" && ending != ".png");
  });
  return names;
}

}  // namespace

std::string FindSevenScenes(const std::string& folder) {
  return FilesEndingIn(folder, kPoseSuffix).empty() ? "" : folder;
}

absl::StatusOr<Scene> ImportSevenScenes(const std::string& folder, const ImportOptions& options) {
  MW_ASSIGN_OR_RETURN(const Lens lens, LensOf(folder, options));
  ImportedScene scene{.format = "7-scenes", .file = folder, .image_folders = {JoinPath(folder, "")}};
  size_t without_pose = 0;
  for (const std::string& name : FilesEndingIn(folder, kPoseSuffix)) {
    const std::string file = JoinPath(folder, name);
    MW_ASSIGN_OR_RETURN(const std::string text, ReadTextFile(file));
    TextFields fields(text, {.file = file, .number = 1});
    Eigen::Matrix4d matrix;
    MW_ASSIGN_OR_RETURN(const bool finite, ReadMatrix4(&fields, &matrix));
    MW_RETURN_IF_ERROR(fields.ExpectEnd());
    if (!finite) {
      ++without_pose;
      continue;
    }
    const Place place{.file = file};
    ImportedView view{.view = {.lens = lens}, .named_at = place};
    view.view.name = name.substr(0, name.size() - (sizeof(kPoseSuffix) - 1)) + kColorSuffix;
    MW_ASSIGN_OR_RETURN(view.view.cam_from_world, PoseOf(matrix, place));
    scene.views.push_back(std::move(view));
  }
  return Finish(std::move(scene), without_pose, options);
}

std::string FindTum(const std::string& folder) {
  const bool both = IsFile(JoinPath(folder, "rgb.txt")) && IsFile(JoinPath(folder, "groundtruth.txt"));
  return both ? folder : "";
}

absl::StatusOr<Scene> ImportTum(const std::string& folder, const ImportOptions& options) {
  MW_ASSIGN_OR_RETURN(const Lens lens, LensOf(folder, options));
  MW_ASSIGN_OR_RETURN(const auto poses, ReadTrajectory(JoinPath(folder, "groundtruth.txt")));
  const std::string file = JoinPath(folder, "rgb.txt");
  MW_ASSIGN_OR_RETURN(const std::string text, ReadTextFile(file));
  ImportedScene scene{.format = "tum", .file = file, .image_folders = {JoinPath(folder, ""), JoinPath(folder, "rgb")}};
  size_t without_pose = 0;
  TextLines lines(text);
  std::string_view line;
  while (lines.NextContent(&line)) {
    const Place place{.file = file, .number = lines.number()};
    TextFields fields(line, place);
    MW_ASSIGN_OR_RETURN(const double time, fields.Number("time"));
    MW_ASSIGN_OR_RETURN(const std::string_view path, fields.Rest("path of a picture"));
    const Rigid3* pose = NearestPose(poses, time);
    if (pose == nullptr) {
      ++without_pose;
      continue;
    }
    ImportedView view{.view = {.lens = lens}, .named_at = place};
    view.view.name = PortableImageName(std::string(path));
    view.view.cam_from_world = *pose;
    scene.views.push_back(std::move(view));
  }
  return Finish(std::move(scene), without_pose, options);
}

std::string FindTanksAndTemples(const std::string& folder) {
  for (const std::string& name : FilesEndingIn(folder, ".log")) {
    // Logs of programs are called so too: a pose's first line has three numbers.
    const std::string file = JoinPath(folder, name);
    const std::string head = ReadHead(file, 200);
    TextFields fields(std::string_view(head).substr(0, head.find('\n')), {.file = file, .number = 1});
    const bool numbers = fields.Number("i").ok() && fields.Number("j").ok() && fields.Number("k").ok();
    if (numbers && fields.AtEnd()) return file;
  }
  return "";
}

absl::StatusOr<Scene> ImportTanksAndTemples(const std::string& file, const ImportOptions& options) {
  const std::string folder = std::filesystem::path(file).parent_path().string();
  MW_ASSIGN_OR_RETURN(const Lens lens, LensOf(file, options));
  MW_ASSIGN_OR_RETURN(const std::string text, ReadTextFile(file));
  const std::string images = options.images_folder.empty() ? JoinPath(folder, "images") : options.images_folder;
  std::vector<std::string> pictures = PicturesIn(images);
  if (pictures.empty()) pictures = PicturesIn(folder);
  ImportedScene scene{.format = "tanks-and-temples", .file = file, .image_folders = {images, JoinPath(folder, "")}};
  size_t without_pose = 0;
  TextFields fields(text, {.file = file, .number = 1});
  while (!fields.AtEnd()) {
    const Place place = fields.place();
    MW_ASSIGN_OR_RETURN(const int64_t i, fields.Integer("i", 0, static_cast<int64_t>(pictures.size()) - 1));
    MW_ASSIGN_OR_RETURN(const double j, fields.Number("j"));
    MW_RETURN_IF_ERROR(fields.Number("k").status());
    Eigen::Matrix4d matrix;
    MW_ASSIGN_OR_RETURN(const bool finite, ReadMatrix4(&fields, &matrix));
    if (!finite || j == -1) {
      ++without_pose;
      continue;
    }
    ImportedView view{.view = {.lens = lens}, .named_at = place};
    view.view.name = pictures[static_cast<size_t>(i)];
    MW_ASSIGN_OR_RETURN(view.view.cam_from_world, PoseOf(matrix, place));
    scene.views.push_back(std::move(view));
  }
  return Finish(std::move(scene), without_pose, options);
}

}  // namespace meshwright
