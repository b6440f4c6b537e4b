// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/calibration_matrix.h"

#include <algorithm>
#include <cmath>

#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"

namespace meshwright {

absl::StatusOr<Lens> LensFromCalibrationMatrix(const Eigen::Matrix3d& k, const Place& place) {
  constexpr double kTolerance = 1e-6;
  const double below = std::max({std::abs(k(1, 0)), std::abs(k(2, 0)), std::abs(k(2, 1))});
  if (!(below <= kTolerance && std::abs(k(2, 2) - 1) <= kTolerance)) {
    return FieldError(place, "K",
                      absl::StrCat("not of the form fx s cx, 0 fy cy, 0 0 1 (second row starts with ", k(1, 0),
                                   ", third row ", k(2, 0), " ", k(2, 1), " ", k(2, 2), ")"),
                      "a calibration matrix");
  }
  if (!(k(0, 0) > 0 && k(1, 1) > 0)) {
    return FieldError(place, "focal length in K", absl::StrCat(k(0, 0), ", ", k(1, 1), " px"), "positive ones");
  }
  return Lens{.fx = k(0, 0), .fy = k(1, 1), .cx = k(0, 2) + 0.5, .cy = k(1, 2) + 0.5, .skew = k(0, 1)};
}

absl::StatusOr<Eigen::Matrix3d> ReadMatrix(TextFields* fields, const char* name) {
  Eigen::Matrix3d matrix;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      MW_ASSIGN_OR_RETURN(matrix(row, column), fields->Number(name));
    }
  }
  return matrix;
}

}  // namespace meshwright
