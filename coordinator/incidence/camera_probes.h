// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Core>

#include "common/scene/scene.h"
#include "coordinator/incidence/pair_geometry.h"

namespace meshwright {

// A few points of the scene that a camera presumably sees, and the depths it sees them at. They stand for its surface
// before there is any: overlap, targets and the fallback for feasible pairs are counted on them, at a cost per pair of
// cameras that does not depend on the scene.
struct CameraProbes {
  std::vector<Eigen::Vector3d> in_world;  // at most kMaxProbes
  double near_depth = 0;                  // scene units; generous bounds of what the camera sees
  double far_depth = 0;
  Eigen::Vector3d frustum_center_in_world = Eigen::Vector3d::Zero();  // ball around the frustum between those depths
  double frustum_radius = 0;
};

constexpr int kProbeColumns = 8;
constexpr int kProbeRows = 6;
constexpr int kMaxProbes = kProbeColumns * kProbeRows;

// Whether a camera with these probes sees the point: in its image and between its near and far depth. Occlusion is not
// known yet.
bool SeesWithinDepths(const CameraGeometry& camera, const CameraProbes& probes, const Eigen::Vector3d& x_in_world);

// Whether two cameras may see a common point at all: whether the balls around their frusta meet. Nanoseconds.
inline bool FrustaMeet(const CameraProbes& a, const CameraProbes& b) {
  const double reach = a.frustum_radius + b.frustum_radius;
  return (a.frustum_center_in_world - b.frustum_center_in_world).squaredNorm() <= reach * reach;
}

// Sparse points that the cameras observed, at most one per cell of a grid over the image. Cameras that observed fewer
// than `min_points` get probes on rays instead, at a depth borrowed from their neighbours (see below).
std::vector<CameraProbes> ProbesFromPoints(const std::vector<CameraGeometry>& cameras,
                                           const std::vector<SparsePoint>& points, int min_points);

// Points on a grid of rays around each camera's typical depth (scene units; 0 = unknown: the median typical depth of
// the nearest cameras that know theirs stands in). No probes when no camera knows its depth.
std::vector<CameraProbes> ProbesFromDepths(const std::vector<CameraGeometry>& cameras,
                                           const std::vector<double>& typical_depths);

}  // namespace meshwright
