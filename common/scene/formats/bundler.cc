// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/bundler.h"

#include <filesystem>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include "common/base/files.h"
#include "common/base/status_macros.h"
#include "common/scene/formats/assemble.h"
#include "common/scene/formats/calibration_matrix.h"
#include "common/scene/formats/lens_and_pose.h"
#include "common/scene/formats/text_fields.h"

namespace meshwright {
namespace {

constexpr char kFirstLine[] = "# Bundle file v0.3";
constexpr int64_t kMost = 1'000'000'000;  // cameras, points or views of a point: each takes bytes of the file

bool IsBundlerFile(const std::string& path) { return ReadHead(path, sizeof(kFirstLine) - 1) == kFirstLine; }

bool NamesPicture(const std::string& word) {
  const std::string ending = LowerCaseEnding(word);
  return ending == ".jpg" || ending == ".jpeg" || ending == ".png" || ending == ".pgm" || ending == ".ppm";
}

struct NamedAt {
  std::string name;
  Place place;
};

// The first words of a list's lines; further ones ("0 1200.5") were for Bundler itself.
absl::StatusOr<std::vector<NamedAt>> ReadList(const std::string& file) {
  MW_ASSIGN_OR_RETURN(const std::string text, ReadTextFile(file));
  std::vector<NamedAt> names;
  TextLines lines(text);
  std::string_view line;
  while (lines.NextContent(&line)) {
    const Place place{.file = file, .number = lines.number()};
    TextFields fields(line, place);
    MW_ASSIGN_OR_RETURN(const std::string_view word, fields.Word("name of a picture"));
    if (!NamesPicture(std::string(word))) {
      return FieldError(place, "name of a picture", Quoted(word), "one that ends in .jpg, .png, .pgm or .ppm");
    }
    names.push_back({PortableImageName(std::string(word)), place});
  }
  return names;
}

absl::StatusOr<std::vector<NamedAt>> FindList(const std::string& file) {
  const std::filesystem::path path(file);
  const std::string folder = path.parent_path().string();
  std::string stem = path.stem().string();  // x of x.out, and of COLMAP's x.bundle.out
  if (stem.ends_with(".bundle")) stem.resize(stem.size() - sizeof(".bundle") + 1);
  for (const std::string& name : {stem + ".list.txt", std::string("list.txt"), std::string("../list.txt")}) {
    if (name.starts_with("..") && NameOfFolder(folder) != "bundle") continue;
    const std::string list = JoinPath(folder, name);
    if (IsFile(list)) return ReadList(list);
  }
  std::vector<std::string> fitting;
  for (const std::string& name : FilesEndingIn(folder, ".txt")) {
    const auto names = ReadList(JoinPath(folder, name));
    if (names.ok() && !names->empty()) fitting.push_back(JoinPath(folder, name));
  }
  if (fitting.size() == 1) return ReadList(fitting.front());
  return absl::NotFoundError(absl::StrCat(file, ": ", fitting.size(), " lists of its photographs beside it (",
                                          absl::StrJoin(fitting, ", "), "); expected ", stem, ".list.txt or list.txt"));
}

// Looks down -Z with Y up, the origin of its pixels at the picture's middle. A focal length of 0 stands for a
// photograph without a pose.
absl::StatusOr<ImportedView> ReadCamera(TextFields* fields, const NamedAt& name) {
  const Place place = fields->place();
  MW_ASSIGN_OR_RETURN(const double focal, fields->Number("f"));
  MW_ASSIGN_OR_RETURN(const double k1, fields->Number("k1"));
  MW_ASSIGN_OR_RETURN(const double k2, fields->Number("k2"));
  MW_ASSIGN_OR_RETURN(const Eigen::Matrix3d matrix, ReadMatrix(fields, "R"));
  Eigen::Vector3d translation;
  for (double& component : translation) {
    MW_ASSIGN_OR_RETURN(component, fields->Number("t"));
  }
  ImportedView imported{.view = {.name = name.name}, .named_at = place};
  if (focal == 0) return imported;
  MW_ASSIGN_OR_RETURN(const Eigen::Matrix3d rotation, NearestRotation(matrix, place));
  imported.view.cam_from_world = {FlipYAndZ(rotation), Eigen::Vector3d(1, -1, -1).asDiagonal() * translation};
  imported.view.lens.fx = focal;
  imported.lens_of_size = [focal, k1, k2](int width, int height) {
    Lens lens{.width = width, .height = height, .fx = focal, .fy = focal, .cx = width / 2.0, .cy = height / 2.0};
    SetDistortion({.k1 = k1, .k2 = k2}, &lens);
    return lens;
  };
  return imported;
}

// X, R G B, then how many cameras see it: number, key and x y of each. `camera_of`: -1 for those without a pose.
absl::StatusOr<SparsePoint> ReadPoint(TextFields* fields, const std::vector<CameraIndex>& camera_of) {
  SparsePoint point;
  for (double& component : point.x_in_world) {
    MW_ASSIGN_OR_RETURN(component, fields->Number("position"));
  }
  for (uint8_t& sample : point.rgb) {
    MW_ASSIGN_OR_RETURN(const int64_t value, fields->Integer("colour", 0, 255));
    sample = static_cast<uint8_t>(value);
  }
  MW_ASSIGN_OR_RETURN(const int64_t views, fields->Integer("number of views", 0, kMost));
  for (int64_t i = 0; i < views; ++i) {
    MW_ASSIGN_OR_RETURN(const int64_t camera, fields->Integer("camera", 0, static_cast<int64_t>(camera_of.size()) - 1));
    MW_RETURN_IF_ERROR(fields->Integer("key", 0, kMost).status());
    MW_RETURN_IF_ERROR(fields->Number("x").status());
    MW_RETURN_IF_ERROR(fields->Number("y").status());
    if (const CameraIndex index = camera_of[static_cast<size_t>(camera)]; index >= 0) point.seen_by.push_back(index);
  }
  return point;
}

}  // namespace

std::string FindBundler(const std::string& folder) {
  for (const char* below : {"", "bundle"}) {
    for (const std::string& name : FilesEndingIn(JoinPath(folder, below), ".out")) {
      std::string file = JoinPath(JoinPath(folder, below), name);
      if (IsBundlerFile(file)) return file;
    }
  }
  return "";
}

absl::StatusOr<Scene> ImportBundler(const std::string& file, const ImportOptions& options) {
  MW_ASSIGN_OR_RETURN(const std::vector<NamedAt> names, FindList(file));
  MW_ASSIGN_OR_RETURN(const std::string text, ReadTextFile(file));
  const size_t first = std::min(text.find('\n'), text.size());
  TextFields fields(std::string_view(text).substr(first), {.file = file, .number = 1});
  MW_ASSIGN_OR_RETURN(const int64_t cameras, fields.Integer("number of cameras", 0, kMost));
  if (static_cast<size_t>(cameras) != names.size()) {
    return FieldError(fields.place(), "number of cameras", absl::StrCat(cameras),
                      absl::StrCat("that of the names in ", names.empty() ? "its list" : names.front().place.file, ", ",
                                   names.size()));
  }
  MW_ASSIGN_OR_RETURN(const int64_t points, fields.Integer("number of points", 0, kMost));
  const std::filesystem::path folder = std::filesystem::path(file).parent_path();
  ImportedScene scene{.format = "bundler", .file = file};
  scene.image_folders = {JoinPath(folder.string(), "images"), JoinPath(folder.string(), "")};
  if (NameOfFolder(folder.string()) == "bundle") {
    scene.image_folders.push_back(JoinPath(folder.string(), "../images"));
    scene.image_folders.push_back(JoinPath(folder.string(), "../"));
  }
  std::vector<CameraIndex> camera_of;
  for (const NamedAt& name : names) {
    MW_ASSIGN_OR_RETURN(ImportedView view, ReadCamera(&fields, name));
    const bool has_pose = view.view.lens.fx != 0;
    camera_of.push_back(has_pose ? static_cast<CameraIndex>(scene.views.size()) : -1);
    if (has_pose) scene.views.push_back(std::move(view));
  }
  if (scene.views.size() < names.size()) {
    scene.warnings.push_back(
        absl::StrCat(names.size() - scene.views.size(), " of ", names.size(), " photographs have no pose"));
  }
  for (int64_t i = 0; i < points; ++i) {
    MW_ASSIGN_OR_RETURN(SparsePoint point, ReadPoint(&fields, camera_of));
    scene.points.push_back(std::move(point));
  }
  MW_RETURN_IF_ERROR(fields.ExpectEnd());
  return AssembleScene(std::move(scene), options);
}

}  // namespace meshwright
