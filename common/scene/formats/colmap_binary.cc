#include "common/scene/formats/colmap_binary.h"

#include <bit>
#include <cmath>
#include <cstring>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>

#include "common/base/files.h"
#include "common/base/status_macros.h"
#include "common/scene/formats/colmap_model.h"
#include "common/scene/formats/text_fields.h"

namespace meshwright {
namespace {

static_assert(std::endian::native == std::endian::little, "COLMAP's binary files are little-endian");

class BinaryFields {
 public:
  BinaryFields(const std::string& bytes, const std::string& file) : bytes_(bytes), place_{file, "record", 0} {}

  const Place& place() const { return place_; }
  void NextRecord() { ++place_.number; }

  template <typename T>
  absl::StatusOr<T> Read(const char* field) {
    if (sizeof(T) > Remaining()) return EndsEarly(field);
    T value{};
    std::memcpy(&value, bytes_.data() + offset_, sizeof(T));
    offset_ += sizeof(T);
    return value;
  }

  absl::StatusOr<double> Number(const char* field) {
    MW_ASSIGN_OR_RETURN(const double value, Read<double>(field));
    if (!std::isfinite(value)) return FieldError(place_, field, absl::StrCat(value), "a finite number");
    return value;
  }

  // A number of things of at least `smallest_bytes` each that follow.
  absl::StatusOr<uint64_t> Count(const char* field, uint64_t smallest_bytes) {
    MW_ASSIGN_OR_RETURN(const uint64_t count, Read<uint64_t>(field));
    const uint64_t room = Remaining() / smallest_bytes;
    if (count > room) {
      return FieldError(place_, field, absl::StrCat(count),
                        absl::StrCat("at most ", room, ", for which the file has bytes"));
    }
    return count;
  }

  absl::StatusOr<std::string> NullTerminated(const char* field) {
    const size_t end = bytes_.find('\0', offset_);
    if (end == std::string::npos) return EndsEarly(field);
    std::string value = bytes_.substr(offset_, end - offset_);
    offset_ = end + 1;
    return value;
  }

  // The caller has made sure that there are so many bytes.
  void Skip(uint64_t count) { offset_ += count; }

  absl::Status ExpectEnd() {
    if (Remaining() == 0) return absl::OkStatus();
    return absl::InvalidArgumentError(
        absl::StrCat(place_.ToString(), ": ", Remaining(), " bytes follow the last record; expected none"));
  }

 private:
  size_t Remaining() const { return bytes_.size() - offset_; }
  absl::Status EndsEarly(const char* field) const {
    return absl::InvalidArgumentError(
        absl::StrCat(place_.ToString(), ": ends early after ", bytes_.size(), " bytes; expected ", field));
  }

  const std::string& bytes_;
  Place place_;
  size_t offset_ = 0;
};

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
// SPDX-License-Identifier: Apache-2.0
