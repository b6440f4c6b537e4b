// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/world_offset.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace meshwright {
namespace {

using Eigen::Vector3d;

Vector3d CenterOf(const SceneView& view) {
  return -(view.cam_from_world.rotation.transpose() * view.cam_from_world.translation);
}

// Of `count` cameras spread over all of them: thousands need not be compared with thousands.
double MedianNearestDistance(const std::vector<Vector3d>& centers) {
  constexpr size_t kMost = 1000;
  const size_t stride = (centers.size() + kMost - 1) / kMost;
  std::vector<double> distances;
  for (size_t i = 0; i < centers.size(); i += stride) {
    double nearest = std::numeric_limits<double>::infinity();
    for (size_t j = 0; j < centers.size(); ++j) {
      if (j != i) nearest = std::min(nearest, (centers[i] - centers[j]).squaredNorm());
    }
    distances.push_back(std::sqrt(nearest));
  }
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  return *middle;
}

}  // namespace

void MoveNearZero(Scene* scene) {
  if (scene->views.size() < 2) return;
  std::vector<Vector3d> centers;
  for (const SceneView& view : scene->views) centers.push_back(CenterOf(view));
  Vector3d centroid = Vector3d::Zero();
  for (const Vector3d& center : centers) centroid += center / static_cast<double>(centers.size());
  double extent = 0;
  for (const Vector3d& center : centers) extent = std::max(extent, (center - centroid).cwiseAbs().maxCoeff());
  const double spacing = MedianNearestDistance(centers);
  constexpr double kExtents = 10;
  constexpr double kSpacings = 1e4;
  const double far = centroid.cwiseAbs().maxCoeff();
  if (!(spacing > 0 && far > kExtents * extent && far > kSpacings * spacing)) return;

  constexpr double kCoarsest = 100;
  const double step = std::min(kCoarsest, std::pow(10.0, std::ceil(std::log10(kCoarsest * spacing))));
  for (int k = 0; k < 3; ++k) {
    if (std::abs(centroid[k]) > kSpacings * spacing) scene->offset[k] = std::round(centroid[k] / step) * step;
  }
  for (SceneView& view : scene->views) {
    view.cam_from_world.translation += view.cam_from_world.rotation * scene->offset;
  }
  for (SparsePoint& point : scene->points) point.x_in_world -= scene->offset;
}

}  // namespace meshwright
