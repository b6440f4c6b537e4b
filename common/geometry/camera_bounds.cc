// SPDX-License-Identifier: Apache-2.0
#include "common/geometry/camera_bounds.h"

#include <cmath>
#include <utility>

#include <Eigen/LU>
#include <absl/strings/str_cat.h>

namespace meshwright {
namespace {

absl::Status Bad(const char* field, double value, const std::string& expected) {
  return absl::InvalidArgumentError(absl::StrCat("camera: ", field, " is ", value, ", expected ", expected));
}

}  // namespace

absl::Status CheckCamera(const Camera& camera) {
  for (const auto& [field, side] : {std::pair{"width", camera.width}, {"height", camera.height}}) {
    if (side < 1 || side > kLargestImageSide) return Bad(field, side, absl::StrCat("1 to ", kLargestImageSide, " px"));
  }
  // Comparisons are written so that NaN fails them.
  for (const auto& [field, focal] : {std::pair{"fx", camera.fx}, {"fy", camera.fy}}) {
    if (!(focal > 1 / kLongestFocal && focal < kLongestFocal)) {
      return Bad(field, focal, absl::StrCat("a number in ", 1 / kLongestFocal, "..", kLongestFocal, " px"));
    }
  }
  for (const auto& [field, center] : {std::pair{"cx", camera.cx}, {"cy", camera.cy}}) {
    if (!(std::abs(center) < kLongestFocal)) return Bad(field, center, absl::StrCat("below ", kLongestFocal, " px"));
  }
  const Eigen::Matrix3d& rotation = camera.cam_from_world.rotation;
  const double error = (rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!rotation.allFinite() || !(error < kRotationTolerance) || !(rotation.determinant() > 0)) {
    return Bad("largest element of R R^T - I", error,
               absl::StrCat("a rotation, below ", kRotationTolerance, " and with determinant 1"));
  }
  for (const double coordinate : camera.cam_from_world.translation) {
    if (!(std::abs(coordinate) < kFarthest)) {
      return Bad("translation", coordinate, absl::StrCat("below ", kFarthest, " scene units"));
    }
  }
  return absl::OkStatus();
}

}  // namespace meshwright
