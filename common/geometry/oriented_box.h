// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include <Eigen/Core>

#include "common/geometry/camera.h"

namespace meshwright {

// A box in any orientation, in some frame.
struct OrientedBox {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();  // its directions as rows, orthonormal
  Eigen::Vector3d size = Eigen::Vector3d::Zero();      // full lengths along them, > 0

  bool Contains(const Eigen::Vector3d& x) const {
    return ((axes * (x - center)).cwiseAbs() - 0.5 * size).maxCoeff() <= 0;
  }
};

// The same box in another frame.
OrientedBox Transformed(const Rigid3& b_from_a, const OrientedBox& box_in_a);

struct DepthInterval {
  double min = 0;  // > 0, scene units
  double max = 0;
};
// Depths z at which a ray from the camera's centre, through (ray.x, ray.y, 1), is in the box; none when it passes by or
// the box is behind the camera.
std::optional<DepthInterval> DepthsInside(const OrientedBox& box_in_cam, const Eigen::Vector3d& ray);

// Whether any of the camera's pixels looks into the box: those of a grid `step` px apart and the border.
bool SeesAnyOf(const Camera& camera, const OrientedBox& box_in_world, int step);

}  // namespace meshwright
