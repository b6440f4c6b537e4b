// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/nvm.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <optional>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"
#include "common/scene/formats/assemble.h"
#include "common/scene/formats/lens_and_pose.h"
#include "common/scene/formats/text_fields.h"

namespace meshwright {
namespace {

constexpr int64_t kMost = 1'000'000'000;  // of anything: each takes bytes of the file

using FixedK = std::array<double, 4>;  // fx cx fy cy

// A model as the file has it.
struct Model {
  std::vector<ImportedView> views;
  std::vector<SparsePoint> points;
};

// The first line: NVM_V3 [FixedK fx cx fy cy].
absl::StatusOr<std::optional<FixedK>> ReadFirstLine(std::string_view line, const Place& place) {
  TextFields fields(line, place);
  MW_ASSIGN_OR_RETURN(const std::string_view magic, fields.Word("NVM_V3"));
  if (magic != "NVM_V3") return FieldError(place, "first word", Quoted(magic), "NVM_V3");
  if (fields.AtEnd()) return std::optional<FixedK>();
  MW_ASSIGN_OR_RETURN(const std::string_view fixed, fields.Word("FixedK"));
  if (fixed != "FixedK") return FieldError(place, "second word", Quoted(fixed), "FixedK or nothing");
  FixedK k;
  for (double& number : k) {
    MW_ASSIGN_OR_RETURN(number, fields.Number("FixedK"));
  }
  MW_RETURN_IF_ERROR(fields.ExpectEnd());
  return std::optional<FixedK>(k);
}

// name f qw qx qy qz Cx Cy Cz d 0, a line each: names with blanks would have more words.
absl::StatusOr<ImportedView> ReadCamera(std::string_view line, const Place& place, const std::optional<FixedK>& fixed) {
  TextFields fields(line, place);
  MW_ASSIGN_OR_RETURN(const std::string_view name, fields.Word("name of a picture"));
  MW_ASSIGN_OR_RETURN(const double focal, fields.Number("focal length"));
  std::array<double, 4> q{};
  for (double& component : q) {
    MW_ASSIGN_OR_RETURN(component, fields.Number("quaternion"));
  }
  Eigen::Vector3d center_in_world;
  for (double& component : center_in_world) {
    MW_ASSIGN_OR_RETURN(component, fields.Number("centre"));
  }
  MW_ASSIGN_OR_RETURN(const double d, fields.Number("radial distortion"));
  MW_RETURN_IF_ERROR(fields.Number("0").status());
  MW_RETURN_IF_ERROR(fields.ExpectEnd());

  ImportedView imported{.view = {.name = PortableImageName(std::string(name))}, .named_at = place};
  const double length = Eigen::Vector4d(q.data()).norm();
  if (!(length > 0)) return FieldError(place, "length of the quaternion", absl::StrCat(length), "1");
  MW_ASSIGN_OR_RETURN(const Eigen::Matrix3d rotation,
                      RotationFromQuaternion(q[0] / length, q[1] / length, q[2] / length, q[3] / length, place));
  imported.view.cam_from_world = PoseFromCenter(rotation, center_in_world);
  imported.lens_of_size = [focal, d, fixed](int width, int height) {
    Lens lens{.width = width, .height = height, .fx = focal, .fy = focal, .cx = width / 2.0, .cy = height / 2.0};
    if (fixed.has_value()) {
      lens.fx = (*fixed)[0];
      lens.cx = (*fixed)[1];
      lens.fy = (*fixed)[2];
      lens.cy = (*fixed)[3];
    }
    SetDistortion({.k1 = -d}, &lens);
    return lens;
  };
  return imported;
}

// X R G B n, then camera, feature, x y of each view; a line each.
absl::StatusOr<SparsePoint> ReadPoint(std::string_view line, const Place& place, size_t cameras) {
  TextFields fields(line, place);
  SparsePoint point;
  for (double& component : point.x_in_world) {
    MW_ASSIGN_OR_RETURN(component, fields.Number("position"));
  }
  for (uint8_t& sample : point.rgb) {
    MW_ASSIGN_OR_RETURN(const int64_t value, fields.Integer("colour", 0, 255));
    sample = static_cast<uint8_t>(value);
  }
  MW_ASSIGN_OR_RETURN(const int64_t views, fields.Integer("number of views", 0, kMost));
  for (int64_t i = 0; i < views; ++i) {
    MW_ASSIGN_OR_RETURN(const int64_t camera, fields.Integer("camera", 0, static_cast<int64_t>(cameras) - 1));
    MW_RETURN_IF_ERROR(fields.Integer("feature", 0, kMost).status());
    MW_RETURN_IF_ERROR(fields.Number("x").status());
    MW_RETURN_IF_ERROR(fields.Number("y").status());
    point.seen_by.push_back(static_cast<CameraIndex>(camera));
  }
  MW_RETURN_IF_ERROR(fields.ExpectEnd());
  return point;
}

class NvmReader {
 public:
  NvmReader(const std::string& file, std::string_view text) : file_(file), lines_(text) {}

  // Those that have photographs.
  absl::StatusOr<std::vector<Model>> Read() {
    if (!Next()) return absl::InvalidArgumentError(absl::StrCat(file_, ": empty; expected NVM_V3"));
    MW_ASSIGN_OR_RETURN(const std::optional<FixedK> fixed, ReadFirstLine(line_, place()));
    std::vector<Model> models;
    while (Next()) {
      MW_ASSIGN_OR_RETURN(const int64_t cameras, Count("number of cameras"));
      if (cameras == 0) break;  // what follows is of the program alone
      Model model;
      for (int64_t i = 0; i < cameras; ++i) {
        if (!Next()) return EndsEarly("a camera");
        MW_ASSIGN_OR_RETURN(ImportedView view, ReadCamera(line_, place(), fixed));
        model.views.push_back(std::move(view));
      }
      if (!Next()) return EndsEarly("number of points");
      MW_ASSIGN_OR_RETURN(const int64_t points, Count("number of points"));
      for (int64_t i = 0; i < points; ++i) {
        if (!Next()) return EndsEarly("a point");
        MW_ASSIGN_OR_RETURN(SparsePoint point, ReadPoint(line_, place(), model.views.size()));
        model.points.push_back(std::move(point));
      }
      models.push_back(std::move(model));
    }
    return models;
  }

 private:
  bool Next() { return lines_.NextContent(&line_); }
  Place place() const { return {.file = file_, .number = lines_.number()}; }
  absl::StatusOr<int64_t> Count(const char* field) {
    TextFields fields(line_, place());
    MW_ASSIGN_OR_RETURN(const int64_t count, fields.Integer(field, 0, kMost));
    MW_RETURN_IF_ERROR(fields.ExpectEnd());
    return count;
  }
  absl::Status EndsEarly(const char* expected) const {
    return absl::InvalidArgumentError(absl::StrCat(place().ToString(), ": ends early; expected ", expected));
  }

  const std::string& file_;
  TextLines lines_;
  std::string_view line_;
};

}  // namespace

absl::StatusOr<Scene> ImportNvm(const std::string& file, const ImportOptions& options) {
  MW_ASSIGN_OR_RETURN(const std::string text, ReadTextFile(file));
  MW_ASSIGN_OR_RETURN(std::vector<Model> models, NvmReader(file, text).Read());
  if (models.empty()) return absl::InvalidArgumentError(absl::StrCat(file, ": no cameras; expected at least one"));
  const std::string folder = std::filesystem::path(file).parent_path().string();
  ImportedScene scene{
      .format = "nvm", .file = file, .image_folders = {JoinPath(folder, ""), JoinPath(folder, "images")}};
  std::vector<size_t> sizes;
  for (const Model& model : models) sizes.push_back(model.views.size());
  MW_ASSIGN_OR_RETURN(const size_t chosen, ChooseLargest(file, sizes, options, &scene.warnings));
  scene.views = std::move(models[chosen].views);
  scene.points = std::move(models[chosen].points);
  return AssembleScene(std::move(scene), options);
}

}  // namespace meshwright
