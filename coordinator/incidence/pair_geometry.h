// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Core>

#include "common/geometry/camera.h"

namespace meshwright {

// What is asked of one camera again and again while pairs are tested, computed once.
struct CameraGeometry {
  explicit CameraGeometry(const Camera& camera);

  // Depth of a world point; its pixel when the depth is positive lies in the image.
  double Depth(const Eigen::Vector3d& x_in_world) const { return axis_in_world.dot(x_in_world - center_in_world); }
  bool Sees(const Eigen::Vector3d& x_in_world) const;

  Camera camera;
  Eigen::Vector3d center_in_world;
  Eigen::Vector3d axis_in_world;  // unit viewing direction
};

std::vector<CameraGeometry> CameraGeometries(const std::vector<Camera>& cameras);

// Why a pair of cameras is feasible or not, each the first test of section 3.2 that failed.
enum class PairOutcome {
  kFeasible,
  kFewPoints,     // fewer common sparse points than asked
  kParallelAxes,  // the transversal of the optical axes is not defined
  kBehindCamera,  // A, B or C behind one of the cameras
  kOutsideImage,  // A, B or C outside one of the images
  kAngleTooSmall,
  kAngleTooLarge,
  kScaleDiffers,
  kOutsideDepths,  // the axes meet where one of the cameras is not likely to see anything
};

// Limits on what two cameras see of one point: the angle between its two rays and the ratio of its sizes.
struct PairLimits {
  double cos_min_angle = 1;
  double cos_max_angle = -1;
  double min_scale_ratio = 0;
};

// Cosine of the angle at a point between the rays to two cameras.
double CosApicalAngle(const CameraGeometry& a, const CameraGeometry& b, const Eigen::Vector3d& x_in_world);

// min / max of the major axes of the ellipses to which a small ball around the point projects (section 3.2). The paper
// says unit ball; units are arbitrary and a unit ball may hold a camera, so it is the limit of a small one: at distance
// rho and depth z the axis is proportional to f rho / z^2. Both depths must be positive.
double ScaleRatio(const CameraGeometry& a, const CameraGeometry& b, const Eigen::Vector3d& x_in_world);

// Angle and scale at a point in front of both cameras: kFeasible, kAngleTooSmall, kAngleTooLarge or kScaleDiffers.
PairOutcome TestPoint(const CameraGeometry& a, const CameraGeometry& b, const Eigen::Vector3d& x_in_world,
                      const PairLimits& limits);

// The test of section 3.2 without sparse points, on the shortest transversal of the optical axes. `midpoint` is set
// when the outcome is kFeasible.
PairOutcome TestTransversal(const CameraGeometry& a, const CameraGeometry& b, const PairLimits& limits,
                            Eigen::Vector3d& midpoint_in_world);

}  // namespace meshwright
