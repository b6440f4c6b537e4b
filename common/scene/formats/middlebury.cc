// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/middlebury.h"

#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include "common/base/status_macros.h"
#include "common/scene/formats/calibration_matrix.h"

namespace meshwright {
namespace {

absl::StatusOr<ImportedView> ReadView(TextFields fields) {
  ImportedView imported;
  MW_ASSIGN_OR_RETURN(const std::string_view name, fields.Word("image name"));
  MW_ASSIGN_OR_RETURN(const Eigen::Matrix3d k, ReadMatrix(&fields, "K"));
  MW_ASSIGN_OR_RETURN(const Eigen::Matrix3d r, ReadMatrix(&fields, "R"));
  for (double& component : imported.view.cam_from_world.translation) {
    MW_ASSIGN_OR_RETURN(component, fields.Number("t"));
  }
  MW_RETURN_IF_ERROR(fields.ExpectEnd());
  imported.view.name = std::string(name);
  imported.named_at = fields.place();
  MW_ASSIGN_OR_RETURN(imported.view.lens, LensFromCalibrationMatrix(k, fields.place()));
  MW_ASSIGN_OR_RETURN(imported.view.cam_from_world.rotation, NearestRotation(r, fields.place()));
  return imported;
}

}  // namespace

absl::StatusOr<Scene> ImportMiddlebury(const std::string& folder, const ImportOptions& options) {
  const std::vector<std::string> files = FilesEndingIn(folder, "_par.txt");
  if (files.size() != 1) {
    return absl::InvalidArgumentError(absl::StrCat(folder, ": ", files.size(), " files *_par.txt (",
                                                   absl::StrJoin(files, ", "), "); expected exactly one"));
  }
  const std::string file = JoinPath(folder, files.front());
  MW_ASSIGN_OR_RETURN(const std::string text, ReadTextFile(file));
  TextLines lines(text);
  std::string_view line;
  if (!lines.NextContent(&line)) {
    return absl::InvalidArgumentError(absl::StrCat(file, ": empty; expected the number of images"));
  }
  TextFields first_line(line, {file, "line", lines.number()});
  MW_ASSIGN_OR_RETURN(const int64_t count, first_line.Integer("number of images", 0, 1'000'000'000));
  MW_RETURN_IF_ERROR(first_line.ExpectEnd());

  std::vector<ImportedView> views;
  while (lines.NextContent(&line)) {
    MW_ASSIGN_OR_RETURN(ImportedView view, ReadView(TextFields(line, {file, "line", lines.number()})));
    views.push_back(std::move(view));
  }
  if (static_cast<int64_t>(views.size()) != count) {
    return absl::InvalidArgumentError(
        absl::StrCat(file, ": ", views.size(), " images; expected ", count, " as its first line says"));
  }
  return AssembleScene({.format = "middlebury",
                        .file = file,
                        .views = std::move(views),
                        .points = {},
                        .image_folders = {JoinPath(folder, "")}},
                       options);
}

}  // namespace meshwright
