// SPDX-License-Identifier: Apache-2.0
#include "common/geometry/oriented_box.h"

#include <random>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

namespace meshwright {
namespace {

TEST(OrientedBoxTest, WhatIsInsideOfItIsWhatRaysMeet) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> number(-1, 1);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d axis(number(random), number(random), number(random));
    const OrientedBox box = {.center = {number(random), number(random), 4 + 3 * number(random)},
                             .axes = Eigen::AngleAxisd(3 * number(random), axis.normalized()).toRotationMatrix(),
                             .size = {1.5 + number(random), 1.5 + number(random), 1.5 + number(random)}};
    const Eigen::Vector3d ray(0.5 * number(random), 0.5 * number(random), 1);
    const auto depths = DepthsInside(box, ray);
    for (double z = 0.0125; z < 10; z += 0.025) {
      const bool inside = depths.has_value() && z >= depths->min && z <= depths->max;
      EXPECT_EQ(box.Contains(z * ray), inside) << i << " " << z;
    }
  }
}

TEST(OrientedBoxTest, IsTheSameInAnotherFrame) {
  const OrientedBox box = {.center = {1, 2, 3}, .axes = Eigen::Matrix3d::Identity(), .size = {2, 1, 4}};
  const Rigid3 motion = {Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 1, 0).normalized()).toRotationMatrix(), {5, -1, 2}};
  const OrientedBox moved = Transformed(motion, box);
  for (double x = -1; x < 3; x += 0.3) {
    const Eigen::Vector3d point(x, 2.4, 2.2);
    EXPECT_EQ(moved.Contains(motion * point), box.Contains(point)) << x;
  }
}

TEST(OrientedBoxTest, ACameraSeesItOrNot) {
  const Camera camera = {.width = 100, .height = 80, .fx = 100, .fy = 100, .cx = 50, .cy = 40};
  OrientedBox box = {.center = {0, 0, 5}, .axes = Eigen::Matrix3d::Identity(), .size = {1, 1, 1}};
  EXPECT_TRUE(SeesAnyOf(camera, box, 8));
  box.center = {0, 0, -5};
  EXPECT_FALSE(SeesAnyOf(camera, box, 8));
  box.center = {5, 0, 5};
  EXPECT_FALSE(SeesAnyOf(camera, box, 8));
  box.center = {2.9, 0, 5};
  EXPECT_TRUE(SeesAnyOf(camera, box, 8));  // at the right border
}

}  // namespace
}  // namespace meshwright
