// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/loop_triangulation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <random>
#include <utility>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

namespace meshwright {
namespace {

using Triangle = std::array<int32_t, 3>;

struct Loop {
  std::vector<Eigen::Vector3d> positions;
  std::vector<Eigen::Vector3d> normals;
};

// A hole in a surface that is seen from +z: clockwise, with noise in all directions.
Loop NoisyLoop(int corners, double noise, std::mt19937& random) {
  std::uniform_real_distribution<double> uniform(-noise, noise);
  Loop loop;
  for (int i = 0; i < corners; ++i) {
    const double angle = -2 * std::numbers::pi * i / corners;
    loop.positions.push_back(Eigen::Vector3d(std::cos(angle), std::sin(angle), 0) +
                             Eigen::Vector3d(uniform(random), uniform(random), uniform(random)));
    loop.normals.push_back(
        (Eigen::Vector3d(0, 0, 1) + Eigen::Vector3d(uniform(random), uniform(random), 0)).normalized());
  }
  return loop;
}

// 1 - cosine between the normals of a triangle and of one of its corners, the worst.
double WorstTurn(const Loop& loop, const std::vector<Triangle>& triangles) {
  double turn = 0;
  for (const Triangle& t : triangles) {
    const auto at = [&](size_t k) { return loop.positions[static_cast<size_t>(t[k])]; };
    const Eigen::Vector3d cross = (at(1) - at(0)).cross(at(2) - at(0));
    for (const int32_t corner : t) {
      turn = std::max(turn, 1 - cross.normalized().dot(loop.normals[static_cast<size_t>(corner)]));
    }
  }
  return turn;
}

// All triangulations of the loop's part between two corners, by definition.
std::vector<std::vector<Triangle>> AllTriangulations(int32_t from, int32_t to) {
  if (to - from < 2) return {{}};
  std::vector<std::vector<Triangle>> all;
  for (int32_t apex = from + 1; apex < to; ++apex) {
    for (const auto& before : AllTriangulations(from, apex)) {
      for (const auto& behind : AllTriangulations(apex, to)) {
        std::vector<Triangle> triangles = before;
        triangles.insert(triangles.end(), behind.begin(), behind.end());
        triangles.push_back({to, apex, from});
        all.push_back(triangles);
      }
    }
  }
  return all;
}

const auto kAnyJoin = [](int32_t, int32_t) { return true; };

TEST(TriangulateLoop, ItsWorstTriangleIsTheBestOfAll) {
  std::mt19937 random(2);
  for (int trial = 0; trial < 20; ++trial) {
    const int corners = 3 + trial % 6;
    const Loop loop = NoisyLoop(corners, 0.8, random);
    double least = std::numeric_limits<double>::infinity();
    for (const auto& triangles : AllTriangulations(0, corners - 1)) {
      least = std::min(least, WorstTurn(loop, triangles));
    }
    EXPECT_NEAR(WorstTurn(loop, TriangulateLoop(loop.positions, loop.normals, kAnyJoin)), least, 1e-12);
  }
}

double AreaOf(const Loop& loop, const std::vector<Triangle>& triangles) {
  double area = 0;
  for (const Triangle& t : triangles) {
    const auto at = [&](size_t k) { return loop.positions[static_cast<size_t>(t[k])]; };
    area += 0.5 * (at(1) - at(0)).cross(at(2) - at(0)).norm();
  }
  return area;
}

TEST(TriangulateLoop, WithoutNormalsItIsTheSmallestOfAllHoweverItIsTurned) {
  std::mt19937 random(4);
  for (int trial = 0; trial < 40; ++trial) {
    const int corners = 3 + trial % 6;
    Loop loop = NoisyLoop(corners, 0.8, random);
    if (trial % 2 == 1) std::ranges::reverse(loop.positions);
    double least = std::numeric_limits<double>::infinity();
    for (const auto& triangles : AllTriangulations(0, corners - 1)) {
      least = std::min(least, AreaOf(loop, triangles));
    }
    EXPECT_NEAR(AreaOf(loop, TriangulateLoop(loop.positions, {}, kAnyJoin)), least, 1e-12);
  }
}

// Each edge of the loop has one triangle, which runs against it; each edge within two, in opposite directions.
TEST(TriangulateLoop, ClosesTheLoop) {
  std::mt19937 random(3);
  for (int corners = 3; corners <= 40; ++corners) {
    const Loop loop = NoisyLoop(corners, 0.1, random);
    const std::vector<Triangle> triangles = TriangulateLoop(loop.positions, loop.normals, kAnyJoin);
    ASSERT_EQ(triangles.size(), static_cast<size_t>(corners - 2));
    std::map<std::pair<int32_t, int32_t>, int> directed;
    for (const Triangle& t : triangles) {
      for (size_t k = 0; k < 3; ++k) ++directed[{t[k], t[(k + 1) % 3]}];
    }
    for (int32_t i = 0; i < corners; ++i) {
      const int32_t next = (i + 1) % corners;
      const int along = directed[{i, next}];
      EXPECT_EQ(along, 0) << "it runs along the border beside it";
      const int against = directed[{next, i}];
      EXPECT_EQ(against, 1);
    }
    for (const auto& [edge, count] : directed) EXPECT_LE(count, 1);
    // Seen from outside they are counter-clockwise.
    EXPECT_LT(WorstTurn(loop, triangles), 1);
  }
}

TEST(TriangulateLoop, JoinsOnlyWhatMayBeJoined) {
  std::mt19937 random(4);
  const Loop square = NoisyLoop(4, 0.05, random);
  const auto not_first = [](int32_t i, int32_t j) { return i != 0 && j != 0; };
  for (const Triangle& t : TriangulateLoop(square.positions, square.normals, not_first)) {
    EXPECT_TRUE(std::ranges::count(t, 0) == 0 || std::ranges::count(t, 2) == 0);
  }
  EXPECT_TRUE(TriangulateLoop(square.positions, square.normals, [](int32_t, int32_t) { return false; }).empty());
  // No triangle without area.
  const std::vector<Eigen::Vector3d> line = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
  EXPECT_TRUE(TriangulateLoop(line, std::vector<Eigen::Vector3d>(3, {0, 0, 1}), kAnyJoin).empty());
}

}  // namespace
}  // namespace meshwright
