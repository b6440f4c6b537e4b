// SPDX-License-Identifier: Apache-2.0
#include "common/geometry/oriented_box.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace meshwright {

OrientedBox Transformed(const Rigid3& b_from_a, const OrientedBox& box_in_a) {
  return {b_from_a * box_in_a.center, box_in_a.axes * b_from_a.rotation.transpose(), box_in_a.size};
}

// Kay and Kajiya 1986: the overlap of the ray's intervals between the three pairs of planes.
std::optional<DepthInterval> DepthsInside(const OrientedBox& box_in_cam, const Eigen::Vector3d& ray) {
  const Eigen::Vector3d origin = -(box_in_cam.axes * box_in_cam.center);
  const Eigen::Vector3d direction = box_in_cam.axes * ray;
  DepthInterval inside = {std::numeric_limits<double>::min(), std::numeric_limits<double>::infinity()};
  for (int k = 0; k < 3; ++k) {
    const double half = 0.5 * box_in_cam.size[k];
    if (std::abs(direction[k]) < 1e-12) {
      if (std::abs(origin[k]) > half) return std::nullopt;
      continue;
    }
    const double a = (-half - origin[k]) / direction[k];
    const double b = (half - origin[k]) / direction[k];
    inside.min = std::max(inside.min, std::min(a, b));
    inside.max = std::min(inside.max, std::max(a, b));
  }
  if (!(inside.max > inside.min)) return std::nullopt;
  return inside;
}

bool SeesAnyOf(const Camera& camera, const OrientedBox& box_in_world, int step) {
  const OrientedBox box_in_cam = Transformed(camera.cam_from_world, box_in_world);
  const auto at = [&](double x, double y) { return DepthsInside(box_in_cam, camera.RayInCam(x, y)).has_value(); };
  for (int y = 0;; y = std::min(y + step, camera.height)) {
    for (int x = 0;; x = std::min(x + step, camera.width)) {
      if (at(x, y)) return true;
      if (x == camera.width) break;
    }
    if (y == camera.height) return false;
  }
}

}  // namespace meshwright
