// SPDX-License-Identifier: Apache-2.0
#include "tools/evaluation/surface_distance.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace meshwright {
namespace {

TEST(PointCloudDistanceTest, AgreesWithTheDistanceToEveryPoint) {
  std::vector<Eigen::Vector3f> cloud;
  cloud.reserve(500);
  uint32_t state = 7;
  const auto next = [&state] {
    state = state * 1664525U + 1013904223U;
    return static_cast<float>(state >> 8U) / 16777216.0F;
  };
  for (int i = 0; i < 500; ++i) cloud.emplace_back(next(), next(), next());
  const PointCloudDistance distance(cloud);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d x(2 * next() - 0.5, 2 * next() - 0.5, 2 * next() - 0.5);
    double expected = std::numeric_limits<double>::infinity();
    for (const Eigen::Vector3f& point : cloud) expected = std::min(expected, (point.cast<double>() - x).norm());
    EXPECT_NEAR(distance.Within(x, std::numeric_limits<double>::infinity()), expected, 1e-9);
    EXPECT_NEAR(distance.Within(x, 1.01 * expected), expected, 1e-9);
    EXPECT_TRUE(std::isinf(distance.Within(x, 0.99 * expected)));
  }
}

TEST(PointCloudDistanceTest, NothingIsNearAnEmptyCloud) {
  const std::vector<Eigen::Vector3f> cloud;
  EXPECT_TRUE(std::isinf(PointCloudDistance(cloud).Within(Eigen::Vector3d::Zero(), 1e9)));
}

}  // namespace
}  // namespace meshwright
