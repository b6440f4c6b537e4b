// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <absl/status/statusor.h>

#include "common/scene/formats/assemble.h"

namespace meshwright {

// The lens of a calibration matrix K for integer pixel centres (Middlebury, Strecha), turned to ours: the principal
// point moves by half a pixel. K must be upper triangular with K(2, 2) = 1. The size is left open.
absl::StatusOr<Lens> LensFromCalibrationMatrix(const Eigen::Matrix3d& k, const Place& place);

// Reads nine numbers, row by row; `name` is "K" or "R".
absl::StatusOr<Eigen::Matrix3d> ReadMatrix(TextFields* fields, const char* name);

}  // namespace meshwright
