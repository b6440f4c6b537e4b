// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/border_stitching.h"

#include <cmath>
#include <map>
#include <numbers>
#include <random>
#include <utility>
#include <vector>

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

}  // namespace
}  // namespace meshwright
