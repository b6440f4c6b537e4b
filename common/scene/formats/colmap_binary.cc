// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/colmap_binary.h"

#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>

#include "common/base/files.h"
#include "common/base/status_macros.h"
#include "common/scene/formats/binary_fields.h"
#include "common/scene/formats/colmap_model.h"
#include "common/scene/formats/text_fields.h"

namespace meshwright {
namespace {

// Bytes that a record takes at least.
constexpr uint64_t kCameraBytes = 4 + 4 + 2 * 8 + 3 * 8;
constexpr uint64_t kImageBytes = 4 + 7 * 8 + 4 + 1 + 8;
constexpr uint64_t kObservationBytes = 3 * 8;
constexpr uint64_t kPointBytes = 8 + 3 * 8 + 3 + 8 + 8;
constexpr uint64_t kTrackElementBytes = 2 * 4;

absl::Status ReadCamera(BinaryFields* fields, ColmapSceneBuilder* builder) {
  MW_ASSIGN_OR_RETURN(const auto camera_id, fields->Read<uint32_t>("camera id"));
  MW_ASSIGN_OR_RETURN(const auto model, fields->Read<int32_t>("camera model"));
  const ColmapModelType* type = FindColmapModelType(model);
  if (type == nullptr) {
    return FieldError(fields->place(), "camera model", absl::StrCat("number ", model),
                      "one of those known: " + KnownColmapModelTypes());
  }
  MW_ASSIGN_OR_RETURN(const auto width, fields->Read<int64_t>("width"));
  MW_ASSIGN_OR_RETURN(const auto height, fields->Read<int64_t>("height"));
  std::vector<double> parameters(static_cast<size_t>(type->parameters));
  for (double& parameter : parameters) {
    MW_ASSIGN_OR_RETURN(parameter, fields->Number("camera parameter"));
  }
  return builder->AddCamera(fields->place(), camera_id, *type, width, height, parameters);
}

absl::Status ReadImage(BinaryFields* fields, ColmapSceneBuilder* builder) {
  MW_ASSIGN_OR_RETURN(const auto image_id, fields->Read<uint32_t>("image id"));
  std::array<double, 4> quaternion{};
  for (double& component : quaternion) {
    MW_ASSIGN_OR_RETURN(component, fields->Number("quaternion"));
  }
  Eigen::Vector3d translation;
  for (double& component : translation) {
    MW_ASSIGN_OR_RETURN(component, fields->Number("translation"));
  }
  MW_ASSIGN_OR_RETURN(const auto camera_id, fields->Read<uint32_t>("camera id"));
  MW_ASSIGN_OR_RETURN(const std::string name, fields->NullTerminated("image name"));
  MW_ASSIGN_OR_RETURN(const uint64_t observations, fields->Count("number of 2D points", kObservationBytes));
  fields->Skip(observations * kObservationBytes);
  return builder->AddImage(fields->place(), image_id, quaternion, translation, camera_id, name,
                           static_cast<int64_t>(observations));
}

absl::Status ReadPoint(BinaryFields* fields, std::vector<std::pair<uint32_t, uint32_t>>* track,
                       ColmapSceneBuilder* builder) {
  MW_RETURN_IF_ERROR(fields->Read<uint64_t>("point id").status());
  Eigen::Vector3d x_in_world;
  for (double& component : x_in_world) {
    MW_ASSIGN_OR_RETURN(component, fields->Number("point"));
  }
  using Rgb = std::array<uint8_t, 3>;
  MW_ASSIGN_OR_RETURN(const Rgb rgb, fields->Read<Rgb>("colour"));
  MW_RETURN_IF_ERROR(fields->Read<double>("error").status());
  MW_ASSIGN_OR_RETURN(const uint64_t length, fields->Count("track length", kTrackElementBytes));
  track->clear();
  for (uint64_t i = 0; i < length; ++i) {
    MW_ASSIGN_OR_RETURN(const auto image_id, fields->Read<uint32_t>("image id in the track"));
    MW_ASSIGN_OR_RETURN(const auto index, fields->Read<uint32_t>("2D point in the track"));
    track->emplace_back(image_id, index);
  }
  return builder->AddPoint(fields->place(), x_in_world, rgb, *track);
}

// A file is a count and so many records.
template <typename ReadRecord>
absl::Status ReadRecords(const std::string& file, const char* count_field, uint64_t smallest_bytes,
                         const ReadRecord& read_record) {
  MW_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(file));
  BinaryFields fields(bytes, file);
  MW_ASSIGN_OR_RETURN(const uint64_t count, fields.Count(count_field, smallest_bytes));
  for (uint64_t i = 0; i < count; ++i) {
    fields.NextRecord();
    MW_RETURN_IF_ERROR(read_record(&fields));
  }
  return fields.ExpectEnd();
}

}  // namespace

absl::StatusOr<Scene> ImportColmapBinary(const std::string& folder, const ImportOptions& options) {
  std::vector<std::string> warnings;
  MW_ASSIGN_OR_RETURN(const std::string model_folder, ChooseColmapModel(folder, "bin", options, &warnings));
  ColmapSceneBuilder builder;
  MW_RETURN_IF_ERROR(ReadRecords(JoinPath(model_folder, "cameras.bin"), "number of cameras", kCameraBytes,
                                 [&](BinaryFields* fields) { return ReadCamera(fields, &builder); }));
  const std::string images_file = JoinPath(model_folder, "images.bin");
  MW_RETURN_IF_ERROR(ReadRecords(images_file, "number of images", kImageBytes,
                                 [&](BinaryFields* fields) { return ReadImage(fields, &builder); }));
  std::vector<std::pair<uint32_t, uint32_t>> track;
  MW_RETURN_IF_ERROR(ReadRecords(JoinPath(model_folder, "points3D.bin"), "number of points", kPointBytes,
                                 [&](BinaryFields* fields) { return ReadPoint(fields, &track, &builder); }));
  return builder.Finish({.format = "colmap-binary",
                         .file = images_file,
                         .image_folders = ColmapImageFolders(model_folder),
                         .warnings = std::move(warnings)},
                        options);
}

}  // namespace meshwright
