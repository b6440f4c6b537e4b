// SPDX-License-Identifier: Apache-2.0
#include "pipeline/cameras/camera_groups.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <string>
#include <tuple>

namespace meshwright {
namespace {

constexpr size_t kEnoughForWideModel = 5;
constexpr double kFilmDiagonalMm = 43.27;         // of 36 x 24 mm
constexpr double kGuessedFocalPerLongSide = 1.2;  // COLMAP's default_focal_length_factor

using Key = std::tuple<std::string, std::string, std::string, std::string, double, double, int, int>;

Key KeyOf(const Photograph& photograph) {
  const ExifCamera& exif = photograph.exif;
  return {std::filesystem::path(photograph.name).parent_path().string(),
          exif.make,
          exif.model,
          exif.lens,
          exif.focal_mm,
          exif.focal_35mm,
          photograph.size.width,
          photograph.size.height};
}

CameraGroup MakeGroup(const Photograph& first) {
  CameraGroup group{.size = first.size, .photographs = {}};
  group.focal_from_exif = first.exif.focal_35mm > 0;
  group.focal_px = group.focal_from_exif
                       ? first.exif.focal_35mm * std::hypot(first.size.width, first.size.height) / kFilmDiagonalMm
                       : kGuessedFocalPerLongSide * std::max(first.size.width, first.size.height);
  return group;
}

}  // namespace

std::vector<CameraGroup> GroupByCamera(const std::vector<Photograph>& photographs) {
  std::vector<CameraGroup> groups;
  std::map<Key, size_t> group_of_key;
  for (size_t i = 0; i < photographs.size(); ++i) {
    const auto [found, is_new] = group_of_key.emplace(KeyOf(photographs[i]), groups.size());
    if (is_new) groups.push_back(MakeGroup(photographs[i]));
    groups[found->second].photographs.push_back(i);
  }
  for (CameraGroup& group : groups) group.wide_model = group.photographs.size() >= kEnoughForWideModel;
  return groups;
}

}  // namespace meshwright
