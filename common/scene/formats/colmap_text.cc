// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/colmap_text.h"

#include <limits>
#include <utility>
#include <vector>

#include "common/base/status_macros.h"
#include "common/scene/formats/colmap_model.h"
#include "common/scene/formats/text_fields.h"

namespace meshwright {
namespace {

constexpr int64_t kLargestId = std::numeric_limits<uint32_t>::max();
constexpr int64_t kLargestInteger = std::numeric_limits<int64_t>::max();

absl::StatusOr<uint32_t> ReadId(TextFields* fields, const char* field) {
  MW_ASSIGN_OR_RETURN(const int64_t id, fields->Integer(field, 0, kLargestId));
  return static_cast<uint32_t>(id);
}

// CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]
absl::Status ReadCamera(TextFields fields, ColmapSceneBuilder* builder) {
  MW_ASSIGN_OR_RETURN(const uint32_t camera_id, ReadId(&fields, "CAMERA_ID"));
  MW_ASSIGN_OR_RETURN(const std::string_view model, fields.Word("MODEL"));
  const ColmapModelType* type = FindColmapModelType(model);
  if (type == nullptr) {
    return FieldError(fields.place(), "MODEL", Quoted(model), "one of " + KnownColmapModelTypes());
  }
  MW_ASSIGN_OR_RETURN(const int64_t width, fields.Integer("WIDTH", 1, kLargestInteger));
  MW_ASSIGN_OR_RETURN(const int64_t height, fields.Integer("HEIGHT", 1, kLargestInteger));
  std::vector<double> parameters(static_cast<size_t>(type->parameters));
  for (double& parameter : parameters) {
    MW_ASSIGN_OR_RETURN(parameter, fields.Number("PARAMS"));
  }
  MW_RETURN_IF_ERROR(fields.ExpectEnd());
  return builder->AddCamera(fields.place(), camera_id, *type, width, height, parameters);
}

// POINTS2D[] as (X, Y, POINT3D_ID); returns how many. Their values are of no use here, but noise must not pass.
absl::StatusOr<int64_t> CountObservations(TextFields fields) {
  int64_t count = 0;
  for (; !fields.AtEnd(); ++count) {
    MW_RETURN_IF_ERROR(fields.Number("X of POINTS2D (every image has two lines, the second may be empty)").status());
    MW_RETURN_IF_ERROR(fields.Number("Y of POINTS2D").status());
    MW_RETURN_IF_ERROR(fields.Integer("POINT3D_ID of POINTS2D", -1, kLargestInteger).status());
  }
  return count;
}

// IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME
absl::Status ReadImage(TextFields fields, TextFields observations, ColmapSceneBuilder* builder) {
  MW_ASSIGN_OR_RETURN(const uint32_t image_id, ReadId(&fields, "IMAGE_ID"));
  std::array<double, 4> quaternion{};
  for (size_t i = 0; i < 4; ++i) {
    constexpr const char* kNames[] = {"QW", "QX", "QY", "QZ"};
    MW_ASSIGN_OR_RETURN(quaternion[i], fields.Number(kNames[i]));
  }
  Eigen::Vector3d translation;
  for (int i = 0; i < 3; ++i) {
    constexpr const char* kNames[] = {"TX", "TY", "TZ"};
    MW_ASSIGN_OR_RETURN(translation[i], fields.Number(kNames[i]));
  }
  MW_ASSIGN_OR_RETURN(const uint32_t camera_id, ReadId(&fields, "CAMERA_ID"));
  MW_ASSIGN_OR_RETURN(const std::string_view name, fields.Rest("NAME"));
  MW_ASSIGN_OR_RETURN(const int64_t count, CountObservations(std::move(observations)));
  return builder->AddImage(fields.place(), image_id, quaternion, translation, camera_id, std::string(name), count);
}

// POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)
absl::Status ReadPoint(TextFields fields, std::vector<std::pair<uint32_t, uint32_t>>* track,
                       ColmapSceneBuilder* builder) {
  MW_RETURN_IF_ERROR(fields.Integer("POINT3D_ID", 0, kLargestInteger).status());
  Eigen::Vector3d x_in_world;
  for (int i = 0; i < 3; ++i) {
    constexpr const char* kNames[] = {"X", "Y", "Z"};
    MW_ASSIGN_OR_RETURN(x_in_world[i], fields.Number(kNames[i]));
  }
  std::array<uint8_t, 3> rgb{};
  for (size_t i = 0; i < 3; ++i) {
    constexpr const char* kNames[] = {"R", "G", "B"};
    MW_ASSIGN_OR_RETURN(const int64_t sample, fields.Integer(kNames[i], 0, 255));
    rgb[i] = static_cast<uint8_t>(sample);
  }
  MW_RETURN_IF_ERROR(fields.Word("ERROR").status());  // some programs write "nan"; it is not used
  track->clear();
  while (!fields.AtEnd()) {
    MW_ASSIGN_OR_RETURN(const uint32_t image_id, ReadId(&fields, "IMAGE_ID of TRACK"));
    MW_ASSIGN_OR_RETURN(const uint32_t index, ReadId(&fields, "POINT2D_IDX of TRACK"));
    track->emplace_back(image_id, index);
  }
  return builder->AddPoint(fields.place(), x_in_world, rgb, *track);
}

}  // namespace

absl::StatusOr<Scene> ImportColmapText(const std::string& folder, const ImportOptions& options) {
  std::vector<std::string> warnings;
  MW_ASSIGN_OR_RETURN(const std::string model_folder, ChooseColmapModel(folder, "txt", options, &warnings));
  ColmapSceneBuilder builder;
  std::string_view line;

  const std::string cameras_file = JoinPath(model_folder, "cameras.txt");
  MW_ASSIGN_OR_RETURN(const std::string cameras, ReadTextFile(cameras_file));
  TextLines camera_lines(cameras);
  while (camera_lines.NextContent(&line)) {
    MW_RETURN_IF_ERROR(ReadCamera(TextFields(line, {cameras_file, "line", camera_lines.number()}), &builder));
  }

  const std::string images_file = JoinPath(model_folder, "images.txt");
  MW_ASSIGN_OR_RETURN(const std::string images, ReadTextFile(images_file));
  TextLines image_lines(images);
  while (image_lines.NextContent(&line)) {
    const Place place{images_file, "line", image_lines.number()};
    std::string_view observations;  // stays empty when the file ends without the last, empty line
    image_lines.Next(&observations);
    MW_RETURN_IF_ERROR(ReadImage(TextFields(line, place),
                                 TextFields(observations, {images_file, "line", place.number + 1}), &builder));
  }

  const std::string points_file = JoinPath(model_folder, "points3D.txt");
  MW_ASSIGN_OR_RETURN(const std::string points, ReadTextFile(points_file));
  TextLines point_lines(points);
  std::vector<std::pair<uint32_t, uint32_t>> track;
  while (point_lines.NextContent(&line)) {
    MW_RETURN_IF_ERROR(ReadPoint(TextFields(line, {points_file, "line", point_lines.number()}), &track, &builder));
  }
  return builder.Finish({.format = "colmap-text",
                         .file = images_file,
                         .image_folders = ColmapImageFolders(model_folder),
                         .warnings = std::move(warnings)},
                        options);
}

}  // namespace meshwright
