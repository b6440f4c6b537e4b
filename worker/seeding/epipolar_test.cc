// SPDX-License-Identifier: Apache-2.0
#include "worker/seeding/epipolar.h"

#include <cmath>
#include <random>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

namespace meshwright {
namespace {

constexpr double kMinAngle = 0.05;
constexpr double kMaxAngle = 1.0;

Camera RandomCamera(std::mt19937& random) {
  std::uniform_real_distribution<double> uniform(-1, 1);
  Camera camera;
  camera.width = 640;
  camera.height = 480;
  camera.fx = 500 + 100 * uniform(random);
  camera.fy = camera.fx;
  camera.cx = 320 + 20 * uniform(random);
  camera.cy = 240;
  const Eigen::Vector3d axis(uniform(random), uniform(random), uniform(random));
  camera.cam_from_world.rotation = Eigen::AngleAxisd(0.6 * uniform(random), axis.normalized()).toRotationMatrix();
  camera.cam_from_world.translation = 3 * Eigen::Vector3d(uniform(random), uniform(random), uniform(random));
  return camera;
}

double ApicalAngle(const Eigen::Vector3d& x, const Camera& a, const Camera& b) {
  const Eigen::Vector3d to_a = (a.center_in_world() - x).normalized();
  const Eigen::Vector3d to_b = (b.center_in_world() - x).normalized();
  return std::atan2(to_a.cross(to_b).norm(), to_a.dot(to_b));
}

TEST(EpipolarTest, TheSegmentIsWhereTheTargetCanMeasure) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(0, 1);
  int inside = 0;
  for (int round = 0; round < 4000; ++round) {
    const Camera reference = RandomCamera(random);
    const Camera target = RandomCamera(random);
    const EpipolarGeometry geometry(reference, target, kMinAngle, kMaxAngle);
    const double x = 640 * unit(random);
    const double y = 480 * unit(random);
    const EpipolarSegment segment = geometry.SegmentOf(x, y, 0.01, 2);
    const double w = 0.01 + 1.99 * unit(random) * unit(random);
    const Eigen::Vector3d x_in_world = reference.BackProject(x, y, 1 / w);
    const Eigen::Vector3d x_in_target = target.CamFromWorld(x_in_world);
    const double angle = ApicalAngle(x_in_world, reference, target);
    const bool measurable = x_in_target.z() * w > 0.1 && target.Contains(target.ProjectFromCam(x_in_target)) &&
                            angle > kMinAngle && angle < kMaxAngle;
    if (segment.Contains(w)) {
      ++inside;
      EXPECT_TRUE(measurable);
      EXPECT_LT((segment.Pixel(w) - target.ProjectFromCam(x_in_target)).norm(), 1e-6);
      EXPECT_NEAR(segment.InverseDepthBeside(segment.Pixel(w)), w, 1e-6);
      EXPECT_FALSE(geometry.SegmentOf(x, y, w, w).empty());
    } else if (measurable) {
      // Only the limit on points very near to the reference may leave out more.
      const double baseline = (reference.center_in_world() - target.center_in_world()).norm();
      EXPECT_LT((x_in_world - reference.center_in_world()).norm(), 0.26 * baseline);
    }
  }
  EXPECT_GT(inside, 300);
}

TEST(EpipolarTest, CamerasAtOnePlaceMeasureNothing) {
  std::mt19937 random(1);
  const Camera camera = RandomCamera(random);
  const EpipolarGeometry geometry(camera, camera, kMinAngle, kMaxAngle);
  EXPECT_TRUE(geometry.SegmentOf(100, 100, 1e-9, 1e9).empty());
}

}  // namespace
}  // namespace meshwright
