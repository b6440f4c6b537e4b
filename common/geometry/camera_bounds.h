// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <absl/status/status.h>

#include "common/geometry/camera.h"

namespace meshwright {

// Bounds within which products of a camera's numbers and of depths stay far from overflow, in double and, for what a
// mesh holds, in float. Real scenes are far inside, also in millimetres from the Earth's centre.
constexpr double kLongestFocal = 1e7;        // px
constexpr double kFarthest = 1e12;           // scene units: coordinates, distances and depths
constexpr double kNearest = 1e-12;           // scene units: depths
constexpr double kRotationTolerance = 1e-3;  // of each element of R R^T - I
constexpr int kLargestImageSide = 1 << 17;   // px

// OK when every number of the camera is one the method can work with; else InvalidArgument names the number, its value
// and what was expected. For cameras that come from outside.
absl::Status CheckCamera(const Camera& camera);

}  // namespace meshwright
