// SPDX-License-Identifier: Apache-2.0
#include "coordinator/nodeodm/odm_files.h"

#include <algorithm>

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include "common/base/relative_path.h"

namespace meshwright {
namespace {

bool IsOneOf(const std::string& name, std::initializer_list<const char*> names) {
  return std::any_of(names.begin(), names.end(), [&](const char* other) { return name == other; });
}

bool EndsWithOneOf(const std::string& name, std::initializer_list<const char*> endings) {
  return std::any_of(endings.begin(), endings.end(), [&](const char* ending) { return absl::EndsWith(name, ending); });
}

// Text files that bring cameras: COLMAP, MVSNet, Middlebury. All others are ground control for ODM.
bool IsCameraText(const std::string& name) {
  return IsOneOf(name, {"cameras.txt", "images.txt", "points3d.txt", "rigs.txt", "frames.txt", "pair.txt"}) ||
         EndsWithOneOf(name, {"_par.txt", "_cam.txt", "_good_silhouette_images.txt"});
}

}  // namespace

OdmFileKind KindOfFile(const std::string& name) {
  const std::string lower = absl::AsciiStrToLower(name);
  const bool is_picture = EndsWithOneOf(lower, {".jpg", ".jpeg", ".png", ".tif", ".tiff", ".ppm", ".pgm"});
  const std::string stem = lower.substr(0, lower.rfind('.'));
  if (absl::StartsWith(lower, "align.") || lower == "seed.zip") return OdmFileKind::kUnused;
  if (is_picture) return absl::EndsWith(stem, "_mask") ? OdmFileKind::kUnused : OdmFileKind::kPhotograph;
  if (absl::EndsWith(lower, ".txt")) return IsCameraText(lower) ? OdmFileKind::kCameras : OdmFileKind::kUnused;
  return OdmFileKind::kCameras;
}

absl::StatusOr<std::string> BaseName(const std::string& file_name) {
  std::string name = file_name.substr(0, file_name.find('\0'));
  name.erase(0, name.find_last_of("/\\") + 1);
  if (!name.empty() && name.front() != '.' && ValidateRelativePath(name).ok()) return name;
  return absl::InvalidArgumentError(absl::StrCat("Invalid file name \"", file_name.substr(0, 64), "\""));
}

std::string OtherName(const std::string& name) {
  const size_t dot = std::min(name.rfind('.'), name.size());
  return absl::StrCat(name.substr(0, dot), "_", name.substr(dot));
}

}  // namespace meshwright
