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

void CloseRim(std::vector<BorderVertex>& rim) {
  for (size_t v = 0; v < rim.size(); ++v) rim[v].next = static_cast<int32_t>((v + 1) % rim.size());
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
  CloseRim(vertices);
  return vertices;
}

// As seen from +z; what faces away counts against it.
double AreaFromAbove(const BorderStitcher& stitcher) {
  double area = 0;
  for (const auto& [a, b, c] : stitcher.faces()) {
    const auto at = [&](int32_t v) { return stitcher.vertices()[static_cast<size_t>(v)].position; };
    area += 0.5 * static_cast<double>((at(b) - at(a)).cross(at(c) - at(a)).z());
  }
  return area;
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
    EXPECT_DOUBLE_EQ(AreaFromAbove(stitcher), 16);
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

// Each edge has two triangles at most, which run along it in opposite directions, and each open edge is in one loop.
void ExpectManifold(const BorderStitcher& stitcher) {
  std::map<std::pair<int32_t, int32_t>, int> directed;
  for (size_t v = 0; v < stitcher.vertices().size(); ++v) {
    ++directed[{static_cast<int32_t>(v), stitcher.vertices()[v].next}];
  }
  for (size_t f = 0; f < stitcher.faces().size(); ++f) {
    if (std::ranges::binary_search(stitcher.faces_alone(), static_cast<int32_t>(f))) continue;
    const BorderStitcher::Face& face = stitcher.faces()[f];
    for (size_t k = 0; k < 3; ++k) ++directed[{face[k], face[(k + 1) % 3]}];
  }
  int64_t open = 0;
  for (const auto& [edge, count] : directed) {
    EXPECT_EQ(count, 1) << edge.first << " to " << edge.second;
    if (!directed.contains({edge.second, edge.first})) ++open;
  }
  EXPECT_EQ(stitcher.CountOpenEdges(), open);
}

TEST(BorderStitcher, TrianglesThatTouchGapsInPointsLeaveSlitsThatAreClosed) {
  const std::vector<BorderVertex> rim = SquareHole();
  BorderStitcher stitcher(rim, {});
  // None of its edges is one of the rim.
  const std::vector<BorderStitcher::Face> apart = {{0, 10, 5}};
  EXPECT_EQ(stitcher.PutIn(apart), 1);
  EXPECT_EQ(stitcher.PutIn(apart), 0) << "it is there already";
  EXPECT_EQ(stitcher.CountOpenEdges(), 19);
  EXPECT_EQ(stitcher.PutIn({{{1, 5, 10}}}), 0) << "it has an edge that is there";
  EXPECT_EQ(stitcher.PutIn({{{1, 2, 7}}}), 0) << "it has an edge of the rim";
  EXPECT_EQ(stitcher.PutIn({{{1, 7, 13}}}), 0) << "it faces the other way";
  EXPECT_EQ(stitcher.CloseSlits(3), 0) << "slits are wider";
  EXPECT_EQ(stitcher.CloseSlits(20), 3);
  EXPECT_EQ(stitcher.CountOpenEdges(), 0);
  ExpectManifold(stitcher);
  EXPECT_DOUBLE_EQ(AreaFromAbove(stitcher), 16);
}

TEST(BorderStitcher, HairsAreNotPutIn) {
  std::vector<BorderVertex> rim = SquareHole();
  rim[2].position.x() += 0.1F;
  BorderStitcher stitcher(rim, {});
  EXPECT_EQ(stitcher.PutIn({{{0, 2, 4}}}), 0);
  rim[2].position.x() += 1;
  EXPECT_EQ(BorderStitcher(rim, {}).PutIn({{{0, 2, 4}}}), 1);
}

// A rim whose one half is a gap, while the other's sides have changed places: surface lies on surface there.
TEST(BorderStitcher, LoopsThatCrossThemselvesAreClosed) {
  std::vector<BorderVertex> rim;
  for (const auto& [x, y] :
       {std::pair(0.F, 0.F), {0.F, 1.F}, {1.F, 1.F}, {3.F, -1.F}, {4.F, -1.F}, {4.F, 1.F}, {3.F, 1.F}, {1.F, 0.F}}) {
    rim.push_back({.position = {x, y, 0}, .normal = {0, 0, 1}, .spacing = 1});
  }
  CloseRim(rim);
  BorderStitcher stitcher(rim, {});
  EXPECT_EQ(stitcher.FillHoles(30, [] {}), 0);
  // The larger half makes the part's inside out of it, were nothing joined to it.
  EXPECT_EQ(stitcher.CloseSlits(20), 0);
  EXPECT_EQ(stitcher.SewOn({{{0, 2, 1}}}), 1);
  EXPECT_EQ(stitcher.CloseSlits(20), 1);
  EXPECT_EQ(stitcher.CountOpenEdges(), 0);
  ExpectManifold(stitcher);
}

TEST(BorderStitcher, TheOutsideOfAPieceIsNoSlit) {
  std::vector<BorderVertex> outside = SquareHole();
  std::ranges::reverse(outside);
  CloseRim(outside);
  BorderStitcher stitcher(outside, {});
  EXPECT_EQ(stitcher.CloseSlits(20), 0);
  EXPECT_EQ(stitcher.CountOpenEdges(), 16);
}

// Between three holes, over the surface that is there.
TEST(BorderStitcher, ATriangleThatMeetsOthersInPointsAloneIsToldApart) {
  std::vector<BorderVertex> rims;
  for (const auto& [x, y] : {std::pair(0.F, 0.F), {20.F, 0.F}, {10.F, 20.F}}) {
    const auto first = static_cast<int32_t>(rims.size());
    for (BorderVertex vertex : SquareHole()) {
      vertex.position += Eigen::Vector3f(x, y, 0);
      vertex.next += first;
      rims.push_back(vertex);
    }
  }
  BorderStitcher stitcher(rims, {});
  // From (4, 4) to (20, 4) and (12, 20), corners and the middle of a side.
  EXPECT_EQ(stitcher.PutIn({{{8, 16 + 4, 32 + 14}}}), 1);
  EXPECT_EQ(stitcher.CloseSlits(20), 3);
  ASSERT_EQ(stitcher.faces_alone().size(), 1U);
  EXPECT_EQ(stitcher.faces_alone()[0], 0);
  EXPECT_EQ(stitcher.CountOpenEdges(), 0);
  ExpectManifold(stitcher);
}

// Whatever triangles are thrown at noisy holes, what comes out is a surface.
TEST(BorderStitcher, AnyTrianglesMakeASurface) {
  std::mt19937 random(5);
  int64_t put_in = 0;
  int64_t closed = 0;
  for (int round = 0; round < 300; ++round) {
    std::vector<BorderVertex> rim;
    std::normal_distribution<float> noise(0, 0.8F);
    const auto corners = static_cast<int32_t>(6 + round % 40);
    const auto loops = 1 + round % 3;
    for (int loop = 0; loop < loops; ++loop) {
      const auto first = static_cast<int32_t>(rim.size());
      for (int32_t i = 0; i < corners; ++i) {
        const double angle = (loop == 0 ? -2 : 2) * std::numbers::pi * i / corners;
        const double radius = corners / (2 * std::numbers::pi) / (1 + loop);
        rim.push_back({.position = Eigen::Vector3f(static_cast<float>(radius * std::cos(angle)) + noise(random),
                                                   static_cast<float>(radius * std::sin(angle)) + noise(random),
                                                   0.3F * noise(random)),
                       .normal = {0, 0, 1},
                       .spacing = 1,
                       .next = first + (i + 1) % corners});
      }
    }
    std::uniform_int_distribution<int32_t> any(0, static_cast<int32_t>(rim.size()) - 1);
    std::vector<BorderStitcher::Face> triangles;
    for (int k = 0; k < 4 * corners; ++k) {
      const BorderStitcher::Face face = {any(random), any(random), any(random)};
      if (face[0] != face[1] && face[1] != face[2] && face[2] != face[0]) triangles.push_back(face);
    }
    BorderStitcher stitcher(rim, {});
    stitcher.SewOn(triangles);
    ExpectManifold(stitcher);
    put_in += stitcher.PutIn(triangles);
    ExpectManifold(stitcher);
    closed += stitcher.CloseSlits(20);
    ExpectManifold(stitcher);
  }
  EXPECT_GT(put_in, 300);
  EXPECT_GT(closed, 300);
}

}  // namespace
}  // namespace meshwright
