// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/mvsnet.h"

#include <cmath>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"
#include "common/scene/formats/assemble.h"
#include "common/scene/formats/calibration_matrix.h"
#include "common/scene/formats/text_fields.h"

namespace meshwright {
namespace {

constexpr char kSuffix[] = "_cam.txt";

std::string CamsIn(const std::string& folder) {
  for (const char* below : {"cams", "cams_1"}) {
    std::string cams = JoinPath(folder, below);
    if (!FilesEndingIn(cams, kSuffix).empty()) return cams;
  }
  return "";
}

absl::Status ExpectWord(TextFields* fields, const char* expected) {
  MW_ASSIGN_OR_RETURN(const std::string_view word, fields->Word(expected));
  if (word == expected) return absl::OkStatus();
  return FieldError(fields->place(), "word", Quoted(word), expected);
}

// A principal point near the middle of a picture that is larger or smaller by a whole factor gives away that K is of
// that one.
absl::StatusOr<Lens> CheckedAgainst(Lens lens, int width, int height, const Place& place) {
  const double x = 2 * lens.cx / width;
  const double y = 2 * lens.cy / height;
  for (const double factor : {0.125, 0.25, 0.5, 2.0, 4.0, 8.0}) {
    constexpr double kNear = 0.2;
    if (std::abs(x / factor - 1) < kNear && std::abs(y / factor - 1) < kNear) {
      return FieldError(place, "principal point", absl::StrCat(lens.cx, ", ", lens.cy),
                        absl::StrCat("one near the middle of the picture, which has ", width, " x ", height,
                                     " px; K seems to be that of a picture ", factor, " times as large"));
    }
  }
  return lens;
}

absl::StatusOr<ImportedView> ReadCamera(const std::string& file, const std::string& name) {
  MW_ASSIGN_OR_RETURN(const std::string text, ReadTextFile(file));
  TextFields fields(text, {file, "line", 1});
  MW_RETURN_IF_ERROR(ExpectWord(&fields, "extrinsic"));
  Eigen::Matrix4d pose;
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) {
      MW_ASSIGN_OR_RETURN(pose(row, column), fields.Number("extrinsic"));
    }
  }
  const Place place{.file = file};
  if (pose.row(3) != Eigen::RowVector4d(0, 0, 0, 1)) {
    return FieldError(fields.place(), "last row of extrinsic", absl::StrCat(pose(3, 0), " ", pose(3, 3)), "0 0 0 1");
  }
  MW_RETURN_IF_ERROR(ExpectWord(&fields, "intrinsic"));
  MW_ASSIGN_OR_RETURN(const Eigen::Matrix3d k, ReadMatrix(&fields, "K"));
  while (!fields.AtEnd()) MW_RETURN_IF_ERROR(fields.Number("depth range").status());

  ImportedView imported{.view = {.name = name}, .named_at = place};
  MW_ASSIGN_OR_RETURN(Lens lens, LensFromCalibrationMatrix(k, place));
  lens.cx -= 0.5;  // which were added for integer pixel centres
  lens.cy -= 0.5;
  imported.lens_of_size = [lens, place](int width, int height) { return CheckedAgainst(lens, width, height, place); };
  MW_ASSIGN_OR_RETURN(imported.view.cam_from_world.rotation, NearestRotation(pose.topLeftCorner<3, 3>(), place));
  imported.view.cam_from_world.translation = pose.topRightCorner<3, 1>();
  return imported;
}

}  // namespace

std::string FindMvsNet(const std::string& folder) { return CamsIn(folder).empty() ? "" : folder; }

absl::StatusOr<Scene> ImportMvsNet(const std::string& folder, const ImportOptions& options) {
  const std::string cams = CamsIn(folder);
  ImportedScene scene{
      .format = "mvsnet", .file = cams, .image_folders = {JoinPath(folder, "images"), JoinPath(folder, "")}};
  for (const std::string& name : FilesEndingIn(cams, kSuffix)) {
    const std::string picture = name.substr(0, name.size() - (sizeof(kSuffix) - 1));
    MW_ASSIGN_OR_RETURN(ImportedView view, ReadCamera(JoinPath(cams, name), picture));
    scene.views.push_back(std::move(view));
  }
  scene.warnings.push_back("no sparse points, which MVSNet's sets do not have; results are better with");
  return AssembleScene(std::move(scene), options);
}

}  // namespace meshwright
