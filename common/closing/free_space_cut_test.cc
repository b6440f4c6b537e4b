// SPDX-License-Identifier: Apache-2.0
#include "common/closing/free_space_cut.h"

#include <cmath>
#include <random>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

namespace meshwright {
namespace {

constexpr double kSpacing = 0.05;

// A wall z = 0, x and y in -1 .. 1, with a hole of radius 0.4 in its middle and a little noise, seen by cameras at z >
// 0.
struct Wall {
  std::vector<MeasuredPoint> points;
  std::vector<Eigen::Vector3d> centers = {{0, 0, 3}, {1, 0.5, 2.5}, {-1, -0.5, 2.5}};
  std::vector<Sight> sights;

  explicit Wall(double hole) {
    std::mt19937 random(1);
    std::uniform_real_distribution<double> noise(-0.2 * kSpacing, 0.2 * kSpacing);
    for (double x = -1; x <= 1; x += kSpacing) {
      for (double y = -1; y <= 1; y += kSpacing) {
        if (std::hypot(x, y) >= hole) Add({x + noise(random), y + noise(random), 0.1 * noise(random)});
      }
    }
  }
  void Add(const Eigen::Vector3d& x) {
    for (int32_t camera = 0; camera < 3; ++camera) sights.push_back({static_cast<int32_t>(points.size()), camera});
    points.push_back({x, kSpacing});
  }
  std::vector<std::array<int32_t, 3>> Cut() const { return CutFreeSpace(points, centers, sights); }

  Eigen::Vector3d At(int32_t i) const { return points[static_cast<size_t>(i)].x_in_world; }
  // Of what faces the cameras, seen from the front and within `radius` of the middle.
  double AreaWithin(const std::vector<std::array<int32_t, 3>>& triangles, double radius, double z) const {
    double area = 0;
    for (const auto& [a, b, c] : triangles) {
      const Eigen::Vector3d middle = (At(a) + At(b) + At(c)) / 3;
      if (std::hypot(middle.x(), middle.y()) > radius || std::abs(middle.z() - z) > 0.02) continue;
      area += 0.5 * (At(b) - At(a)).cross(At(c) - At(a)).z();
    }
    return area;
  }
};

TEST(CutFreeSpace, ClosesAHoleThroughWhichNobodySaw) {
  const Wall wall(0.4);
  const auto triangles = wall.Cut();
  EXPECT_NEAR(wall.AreaWithin(triangles, 0.9, 0), M_PI * 0.9 * 0.9, 0.15);
  EXPECT_GT(wall.AreaWithin(triangles, 0.35, 0), 0.3) << "the hole itself; triangles face the cameras";
}

TEST(CutFreeSpace, LeavesAHoleOpenThroughWhichSurfaceWasSeen) {
  Wall wall(0.4);
  for (double x = -0.35; x <= 0.35; x += kSpacing) {
    for (double y = -0.35; y <= 0.35; y += kSpacing) {
      if (std::hypot(x, y) <= 0.35) wall.Add({x, y, -0.2 + 0.003 * std::sin(50 * x + 70 * y)});
    }
  }
  const auto triangles = wall.Cut();
  EXPECT_LT(wall.AreaWithin(triangles, 0.25, 0), 0.02);
  EXPECT_GT(wall.AreaWithin(triangles, 0.25, -0.2), 0.15) << "what was seen is surface";
}

TEST(CutFreeSpace, TheSameTwice) {
  const Wall wall(0.3);
  EXPECT_EQ(wall.Cut(), wall.Cut());
}

TEST(CutFreeSpace, TooFewPointsHaveNone) {
  EXPECT_TRUE(CutFreeSpace({}, {}, {}).empty());
  const std::vector<MeasuredPoint> one = {{{0, 0, 0}, 1}};
  const std::vector<Eigen::Vector3d> centers = {{0, 0, 1}};
  EXPECT_TRUE(CutFreeSpace(one, centers, std::vector<Sight>{{0, 0}}).empty());
}

}  // namespace
}  // namespace meshwright
