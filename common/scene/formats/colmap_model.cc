// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/colmap_model.h"

#include <algorithm>
#include <cstring>
#include <filesystem>

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include "common/base/files.h"
#include "common/base/status_macros.h"

namespace meshwright {
namespace {

constexpr ColmapModelType kTypes[] = {
    {0, "SIMPLE_PINHOLE", Lens::Model::kPinhole, 3, true},
    {1, "PINHOLE", Lens::Model::kPinhole, 4, false},
    {2, "SIMPLE_RADIAL", Lens::Model::kRadial, 4, true},
    {3, "RADIAL", Lens::Model::kRadial, 5, true},
    {4, "OPENCV", Lens::Model::kOpenCv, 8, false},
    {5, "OPENCV_FISHEYE", Lens::Model::kOpenCvFisheye, 8, false},
    {6, "FULL_OPENCV", Lens::Model::kFullOpenCv, 12, false},
    {7, "FOV", Lens::Model::kFov, 5, false},
    {8, "SIMPLE_RADIAL_FISHEYE", Lens::Model::kRadialFisheye, 4, true},
    {9, "RADIAL_FISHEYE", Lens::Model::kRadialFisheye, 5, true},
    {10, "THIN_PRISM_FISHEYE", Lens::Model::kThinPrismFisheye, 12, false},
    {11, "RAD_TAN_THIN_PRISM_FISHEYE", Lens::Model::kRadTanThinPrismFisheye, 16, false},
    {12, "SIMPLE_DIVISION", Lens::Model::kDivision, 4, true},
    {13, "DIVISION", Lens::Model::kDivision, 5, false},
    {16, "EUCM", Lens::Model::kEucm, 6, false},
    // The angle itself: OPENCV_FISHEYE with all coefficients 0.
    {14, "SIMPLE_FISHEYE", Lens::Model::kOpenCvFisheye, 3, true},
    {15, "FISHEYE", Lens::Model::kOpenCvFisheye, 4, false},
};

bool HasModel(const std::string& folder, const std::string& extension) {
  return IsFile(JoinPath(folder, "cameras." + extension)) && IsFile(JoinPath(folder, "images." + extension));
}

std::string NumberedFolder(const std::string& folder, int number) { return JoinPath(folder, absl::StrCat(number)); }

// Below a hundred million, which is more than anybody has.
bool IsNumber(const std::string& name) {
  constexpr size_t kMostDigits = 8;
  return !name.empty() && name.size() <= kMostDigits && name.find_first_not_of("0123456789") == std::string::npos;
}

// Sorted.
std::vector<int> NumberedModels(const std::string& folder, const std::string& extension) {
  std::vector<int> numbers;
  std::error_code error;
  std::filesystem::directory_iterator it(folder, error);
  for (; !error && it != std::filesystem::directory_iterator(); it.increment(error)) {
    const std::string name = it->path().filename().string();
    int number = 0;
    if (!IsNumber(name) || !absl::SimpleAtoi(name, &number) || absl::StrCat(number) != name) continue;
    if (HasModel(it->path().string(), extension)) numbers.push_back(number);
  }
  std::sort(numbers.begin(), numbers.end());
  return numbers;
}

absl::StatusOr<int64_t> CountImages(const std::string& folder, const std::string& extension) {
  if (extension == "bin") {
    MW_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(JoinPath(folder, "images.bin")));
    int64_t count = 0;
    if (bytes.size() >= sizeof(count)) std::memcpy(&count, bytes.data(), sizeof(count));
    return count;
  }
  MW_ASSIGN_OR_RETURN(const std::string text, ReadTextFile(JoinPath(folder, "images.txt")));
  TextLines lines(text);
  std::string_view line;
  int64_t count = 0;
  for (; lines.NextContent(&line); ++count) lines.Next(&line);  // every image has two lines
  return count;
}

}  // namespace

const ColmapModelType* FindColmapModelType(int id) {
  for (const ColmapModelType& type : kTypes) {
    if (type.id == id) return &type;
  }
  return nullptr;
}

const ColmapModelType* FindColmapModelType(std::string_view name) {
  for (const ColmapModelType& type : kTypes) {
    if (type.name == name) return &type;
  }
  return nullptr;
}

std::string KnownColmapModelTypes() {
  std::string names;
  for (const ColmapModelType& type : kTypes) absl::StrAppend(&names, names.empty() ? "" : ", ", type.name);
  return names;
}

absl::Status ColmapSceneBuilder::AddCamera(const Place& place, uint32_t camera_id, const ColmapModelType& type,
                                           int64_t width, int64_t height, const std::vector<double>& parameters) {
  constexpr int64_t kLargestSide = 1'000'000;  // px; CheckLens holds the product
  if (width < 1 || height < 1 || width > kLargestSide || height > kLargestSide) {
    return FieldError(place, "image size", absl::StrCat(width, " x ", height),
                      absl::StrCat("sizes from 1 to ", kLargestSide, " px"));
  }
  Lens lens{.width = static_cast<int>(width), .height = static_cast<int>(height), .model = type.model};
  const size_t focals = type.single_focal ? 1 : 2;
  lens.fx = parameters[0];
  lens.fy = parameters[focals - 1];
  lens.cx = parameters[focals];
  lens.cy = parameters[focals + 1];
  // Our coefficients stand in COLMAP's order.
  for (size_t i = focals + 2; i < parameters.size(); ++i) lens.coefficients[i - focals - 2] = parameters[i];
  MW_RETURN_IF_ERROR(CheckLens(lens, place));
  if (!lenses_.emplace(camera_id, lens).second) {
    return FieldError(place, "CAMERA_ID", absl::StrCat(camera_id), "an id not used before");
  }
  return absl::OkStatus();
}

absl::Status ColmapSceneBuilder::AddImage(const Place& place, uint32_t image_id,
                                          const std::array<double, 4>& quaternion, const Eigen::Vector3d& translation,
                                          uint32_t camera_id, const std::string& name, int64_t observations) {
  const auto lens = lenses_.find(camera_id);
  if (lens == lenses_.end()) {
    return FieldError(place, "CAMERA_ID", absl::StrCat(camera_id), "the id of a camera in the cameras file");
  }
  if (!translation.allFinite()) return FieldError(place, "TX TY TZ", "not finite", "finite numbers");
  ImportedView imported{.view = {.name = name, .image_path = "", .lens = lens->second}, .named_at = place};
  MW_ASSIGN_OR_RETURN(imported.view.cam_from_world.rotation,
                      RotationFromQuaternion(quaternion[0], quaternion[1], quaternion[2], quaternion[3], place));
  imported.view.cam_from_world.translation = translation;
  const ImageRecord record{static_cast<CameraIndex>(views_.size()), observations};
  if (!images_.emplace(image_id, record).second) {
    return FieldError(place, "IMAGE_ID", absl::StrCat(image_id), "an id not used before");
  }
  views_.push_back(std::move(imported));
  return absl::OkStatus();
}

absl::Status ColmapSceneBuilder::AddPoint(const Place& place, const Eigen::Vector3d& x_in_world,
                                          const std::array<uint8_t, 3>& rgb,
                                          const std::vector<std::pair<uint32_t, uint32_t>>& track) {
  if (!x_in_world.allFinite()) return FieldError(place, "X Y Z", "not finite", "finite numbers");
  SparsePoint point{.x_in_world = x_in_world, .rgb = rgb, .seen_by = {}};
  point.seen_by.reserve(track.size());
  for (const auto& [image_id, index] : track) {
    const auto image = images_.find(image_id);
    if (image == images_.end()) {
      return FieldError(place, "IMAGE_ID in the track", absl::StrCat(image_id),
                        "the id of an image in the images file");
    }
    // Some programs write tracks but leave the images' own lists empty.
    if (image->second.observations > 0 && index >= image->second.observations) {
      return FieldError(place, "POINT2D_IDX in the track", absl::StrCat(index),
                        absl::StrCat("less than the ", image->second.observations, " points of image ", image_id));
    }
    point.seen_by.push_back(image->second.view);
  }
  points_.push_back(std::move(point));
  return absl::OkStatus();
}

absl::StatusOr<Scene> ColmapSceneBuilder::Finish(ImportedScene scene, const ImportOptions& options) {
  scene.views = std::move(views_);
  scene.points = std::move(points_);
  return AssembleScene(std::move(scene), options);
}

std::string FindColmapModels(const std::string& folder, const std::string& extension) {
  for (const char* below : {"", "model", "sparse", "colmap/sparse"}) {
    std::string candidate = JoinPath(folder, below);
    if (HasModel(candidate, extension) || !NumberedModels(candidate, extension).empty()) return candidate;
  }
  return "";
}

std::string ColmapModelFiles(const std::string& extension) {
  return absl::StrCat("cameras.", extension, " and images.", extension, " here or in model/, sparse/ or sparse/N/");
}

absl::StatusOr<std::string> ChooseColmapModel(const std::string& folder, const std::string& extension,
                                              const ImportOptions& options, std::vector<std::string>* warnings) {
  const std::vector<int> numbers = HasModel(folder, extension) ? std::vector<int>() : NumberedModels(folder, extension);
  if (options.model.has_value() && std::find(numbers.begin(), numbers.end(), *options.model) == numbers.end()) {
    return absl::NotFoundError(absl::StrCat(
        folder, ": model is ", *options.model, "; expected ",
        numbers.empty() ? "none, as there is one model only" : absl::StrCat("one of ", absl::StrJoin(numbers, ", "))));
  }
  if (numbers.empty()) return folder;
  std::vector<int64_t> images;
  for (const int number : numbers) {
    MW_ASSIGN_OR_RETURN(const int64_t count, CountImages(NumberedFolder(folder, number), extension));
    images.push_back(count);
  }
  size_t chosen = static_cast<size_t>(std::max_element(images.begin(), images.end()) - images.begin());
  for (size_t i = 0; i < numbers.size(); ++i) {
    if (numbers[i] == options.model) chosen = i;
  }
  for (size_t i = 0; i < numbers.size(); ++i) {
    if (i == chosen) continue;
    warnings->push_back(absl::StrCat("cameras of ", NumberedFolder(folder, numbers[i]), " (", images[i],
                                     " photographs) are another reconstruction and are not used; --model ", numbers[i],
                                     " takes them"));
  }
  return NumberedFolder(folder, numbers[chosen]);
}

std::vector<std::string> ColmapImageFolders(const std::string& model_folder) {
  std::vector<std::string> folders;
  std::string folder = JoinPath(model_folder, "");
  for (std::string name = NameOfFolder(folder);; name = NameOfFolder(folder)) {
    folders.push_back(JoinPath(folder, "images"));
    folders.push_back(folder);
    const std::string above = JoinPath(folder, "../");
    const bool holds_models = name == "sparse" || name == "colmap" || name == "model";
    const bool is_numbered = IsNumber(name) && NameOfFolder(above) == "sparse";
    if (!holds_models && !is_numbered) return folders;
    folder = above;
  }
}

}  // namespace meshwright
