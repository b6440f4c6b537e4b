// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/border_stitching.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <random>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

namespace meshwright {
namespace {

// Rims of small holes in surfaces whose noise is as large as the distance between vertices fold over: an advancing
// front, which wants to see its triangles lie side by side, leaves a third of them open.
TEST(BorderStitcher, HolesInNoiseAreClosed) {
  std::mt19937 random(3);
  constexpr int kHoles = 300;
  constexpr float kSpacing = 0.1F;
  std::normal_distribution<float> noise(0, 0.6F * kSpacing);
  std::vector<BorderVertex> vertices;
  for (int hole = 0; hole < kHoles; ++hole) {
    const int corners = 4 + hole % 9;
    const auto first = static_cast<int32_t>(vertices.size());
    const double radius = kSpacing * corners / (2 * std::numbers::pi);
    for (int i = 0; i < corners; ++i) {
      // Clockwise, with the surface to the left.
      const double angle = -2 * std::numbers::pi * i / corners;
      BorderVertex vertex;
      vertex.position =
          Eigen::Vector3f(static_cast<float>(10 * hole + radius * std::cos(angle)) + noise(random),
                          static_cast<float>(radius * std::sin(angle)) + noise(random), 0.3F * noise(random));
      vertex.normal = Eigen::Vector3f(0, 0, 1);
      vertex.spacing = kSpacing;
      vertex.next = first + (i + 1) % corners;
      vertices.push_back(vertex);
    }
  }
  BorderStitcher stitcher(vertices, {});
  const int64_t closed = stitcher.FillHoles(30, [] {});
  // What folded over as a whole is no hole.
  EXPECT_GT(closed, kHoles * 8 / 10);
  size_t rims = 0;
  std::map<std::pair<int32_t, int32_t>, int> directed;
  for (const BorderStitcher::Face& face : stitcher.faces()) {
    for (size_t k = 0; k < 3; ++k) ++directed[{face[k], face[(k + 1) % 3]}];
  }
  for (const auto& [edge, count] : directed) EXPECT_EQ(count, 1) << "no edge has two triangles in the same direction";
  for (size_t v = 0; v < vertices.size(); ++v) {
    const std::pair along(static_cast<int32_t>(v), vertices[v].next);
    EXPECT_FALSE(directed.contains(along)) << "triangles run against the border";
    if (directed.contains({along.second, along.first})) ++rims;
  }
  EXPECT_EQ(static_cast<size_t>(stitcher.CountOpenEdges()), vertices.size() - rims);
}

// A square hole of 4 x 4 in the plane, its corners and its rim at whole numbers.
std::vector<BorderVertex> SquareHole() {
  std::vector<BorderVertex> vertices;
  const auto add = [&](float x, float y) {
    vertices.push_back({.position = {x, y, 0}, .normal = {0, 0, 1}, .spacing = 1});
  };
  // Clockwise, with the surface to the left.
  for (int y = 0; y < 4; ++y) add(0, static_cast<float>(y));
  for (int x = 0; x < 4; ++x) add(static_cast<float>(x), 4);
  for (int y = 4; y > 0; --y) add(4, static_cast<float>(y));
  for (int x = 4; x > 0; --x) add(static_cast<float>(x), 0);
  for (size_t v = 0; v < vertices.size(); ++v) vertices[v].next = static_cast<int32_t>((v + 1) % vertices.size());
  return vertices;
}

// Around corner 0, counter-clockwise.
std::vector<BorderStitcher::Face> Fan(int32_t corners) {
  std::vector<BorderStitcher::Face> fan;
  for (int32_t v = 1; v + 1 < corners; ++v) fan.push_back({0, v + 1, v});
  return fan;
}

TEST(BorderStitcher, TrianglesAreSewnOnInWhateverOrderTheyCome) {
  const std::vector<BorderVertex> rim = SquareHole();
  // Those along two sides are without area: the fan closes all but them.
  std::vector<BorderStitcher::Face> fan = Fan(static_cast<int32_t>(rim.size()));
  std::mt19937 random(1);
  for (int round = 0; round < 5; ++round) {
    std::ranges::shuffle(fan, random);
    BorderStitcher stitcher(rim, {});
    EXPECT_EQ(stitcher.SewOn(fan), 8);
    double area = 0;
    for (const auto& [a, b, c] : stitcher.faces()) {
      const auto at = [&](int32_t v) { return rim[static_cast<size_t>(v)].position; };
      area += 0.5 * static_cast<double>((at(b) - at(a)).cross(at(c) - at(a)).z());
    }
    EXPECT_DOUBLE_EQ(area, 16);
  }
}

TEST(BorderStitcher, TrianglesThatDoNotFitAreNotSewnOn) {
  const std::vector<BorderVertex> rim = SquareHole();
  BorderStitcher stitcher(rim, {});
  const std::vector<BorderStitcher::Face> folded = {{0, 5, 6}};
  EXPECT_EQ(stitcher.SewOn(folded), 0) << "it faces the other way";
  const std::vector<BorderStitcher::Face> apart = {{0, 10, 5}};
  EXPECT_EQ(stitcher.SewOn(apart), 0) << "it has no open edge";
  const std::vector<BorderStitcher::Face> fits = {{0, 6, 5}};
  EXPECT_EQ(stitcher.SewOn(fits), 1);
  EXPECT_EQ(stitcher.SewOn(fits), 0) << "it is there already";
  EXPECT_EQ(stitcher.CountOpenEdges(), 17);
}

}  // namespace
}  // namespace meshwright
