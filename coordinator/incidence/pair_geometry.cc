// SPDX-License-Identifier: Apache-2.0
#include "coordinator/incidence/pair_geometry.h"

#include <algorithm>
#include <cmath>

namespace meshwright {
namespace {

// Axes closer than about 0.06 degrees meet, if at all, a thousand baselines away.
constexpr double kParallelSquaredSine = 1e-6;

}  // namespace

CameraGeometry::CameraGeometry(const Camera& the_camera)
    : camera(the_camera),
      center_in_world(the_camera.center_in_world()),
      axis_in_world(the_camera.viewing_direction_in_world()) {}

bool CameraGeometry::Sees(const Eigen::Vector3d& x_in_world) const {
  const Eigen::Vector3d x_in_cam = camera.CamFromWorld(x_in_world);
  return x_in_cam.z() > 0 && camera.Contains(camera.ProjectFromCam(x_in_cam));
}

std::vector<CameraGeometry> CameraGeometries(const std::vector<Camera>& cameras) {
  std::vector<CameraGeometry> geometries;
  geometries.reserve(cameras.size());
  for (const Camera& camera : cameras) geometries.emplace_back(camera);
  return geometries;
}

double CosApicalAngle(const CameraGeometry& a, const CameraGeometry& b, const Eigen::Vector3d& x_in_world) {
  const Eigen::Vector3d to_a = a.center_in_world - x_in_world;
  const Eigen::Vector3d to_b = b.center_in_world - x_in_world;
  return to_a.dot(to_b) / std::sqrt(to_a.squaredNorm() * to_b.squaredNorm());
}

double ScaleRatio(const CameraGeometry& a, const CameraGeometry& b, const Eigen::Vector3d& x_in_world) {
  const double depth_a = a.Depth(x_in_world);
  const double depth_b = b.Depth(x_in_world);
  const double size_a = a.camera.focal() * (x_in_world - a.center_in_world).norm() / (depth_a * depth_a);
  const double size_b = b.camera.focal() * (x_in_world - b.center_in_world).norm() / (depth_b * depth_b);
  return std::min(size_a, size_b) / std::max(size_a, size_b);
}

PairOutcome TestPoint(const CameraGeometry& a, const CameraGeometry& b, const Eigen::Vector3d& x_in_world,
                      const PairLimits& limits) {
  const double cos_angle = CosApicalAngle(a, b, x_in_world);
  if (cos_angle > limits.cos_min_angle) return PairOutcome::kAngleTooSmall;
  if (!(cos_angle >= limits.cos_max_angle)) return PairOutcome::kAngleTooLarge;
  return ScaleRatio(a, b, x_in_world) >= limits.min_scale_ratio ? PairOutcome::kFeasible : PairOutcome::kScaleDiffers;
}

PairOutcome TestTransversal(const CameraGeometry& a, const CameraGeometry& b, const PairLimits& limits,
                            Eigen::Vector3d& midpoint_in_world) {
  const Eigen::Vector3d a_from_b = a.center_in_world - b.center_in_world;
  const double cosine = a.axis_in_world.dot(b.axis_in_world);
  const double squared_sine = 1 - cosine * cosine;
  if (squared_sine < kParallelSquaredSine) return PairOutcome::kParallelAxes;
  const double along_a = a.axis_in_world.dot(a_from_b);
  const double along_b = b.axis_in_world.dot(a_from_b);
  const double depth_of_a = (cosine * along_b - along_a) / squared_sine;
  const double depth_of_b = (along_b - cosine * along_a) / squared_sine;
  if (depth_of_a <= 0 || depth_of_b <= 0) return PairOutcome::kBehindCamera;
  const Eigen::Vector3d end_a = a.center_in_world + depth_of_a * a.axis_in_world;
  const Eigen::Vector3d end_b = b.center_in_world + depth_of_b * b.axis_in_world;
  const Eigen::Vector3d middle = 0.5 * (end_a + end_b);
  for (const CameraGeometry* camera : {&a, &b}) {
    for (const Eigen::Vector3d* point : {&end_a, &end_b, &middle}) {
      if (camera->Depth(*point) <= 0) return PairOutcome::kBehindCamera;
    }
  }
  for (const CameraGeometry* camera : {&a, &b}) {
    for (const Eigen::Vector3d* point : {&end_a, &end_b, &middle}) {
      if (!camera->Sees(*point)) return PairOutcome::kOutsideImage;
    }
  }
  midpoint_in_world = middle;
  return TestPoint(a, b, middle, limits);
}

}  // namespace meshwright
