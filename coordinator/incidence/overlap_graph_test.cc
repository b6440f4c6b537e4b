// SPDX-License-Identifier: Apache-2.0
#include "coordinator/incidence/overlap_graph.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "coordinator/incidence/cameras_testing.h"
#include "coordinator/incidence/feasible_pairs.h"

namespace meshwright {
namespace {

OverlapGraph Overlaps(const std::vector<Camera>& cameras, double depth) {
  ThreadPool pool(2);
  const std::vector<CameraGeometry> geometries = CameraGeometries(cameras);
  return FindOverlaps(geometries, ProbesFromDepths(geometries, std::vector<double>(cameras.size(), depth)),
                      IncidenceMatrix(static_cast<int>(cameras.size())), {}, pool);
}

TEST(OverlapGraph, TwoPhotographsFromOneSpotOverlap) {
  const OverlapGraph overlaps =
      Overlaps({CameraLookingAt({0, 0, 0}, {0, 10, 0}), CameraLookingAt({0.01, 0, 0}, {0.5, 10, 0})}, 10);
  EXPECT_TRUE(overlaps.Overlap(0, 1));
  EXPECT_TRUE(overlaps.Overlap(1, 0));
}

TEST(OverlapGraph, OppositeSidesOfAnObjectDoNot) {
  std::vector<Camera> cameras;
  for (int i = 0; i < 36; ++i) {
    const double angle = i * std::numbers::pi / 18;
    cameras.push_back(CameraLookingAt({5 * std::cos(angle), 5 * std::sin(angle), 0}, {0, 0, 0}));
  }
  const OverlapGraph overlaps = Overlaps(cameras, 5);
  EXPECT_TRUE(overlaps.Overlap(0, 9));
  EXPECT_FALSE(overlaps.Overlap(0, 18));
  for (CameraIndex i = 0; i < 36; ++i) {
    EXPECT_FALSE(overlaps.Overlap(i, i));
    EXPECT_TRUE(std::is_sorted(overlaps.Of(i).begin(), overlaps.Of(i).end()));
    for (const CameraIndex j : overlaps.Of(i)) EXPECT_TRUE(overlaps.Overlap(j, i));
  }
}

TEST(OverlapGraph, DifferentPlacesDoNot) {
  const OverlapGraph overlaps =
      Overlaps({CameraLookingAt({0, 0, 0}, {0, 10, 0}), CameraLookingAt({0, 0, 0}, {0, -10, 0}),
                CameraLookingAt({100, 0, 0}, {100, 10, 0})},
               10);
  EXPECT_FALSE(overlaps.Overlap(0, 1));
  EXPECT_FALSE(overlaps.Overlap(0, 2));
}

TEST(OverlapGraph, FeasiblePairsAlwaysDo) {
  ThreadPool pool(1);
  IncidenceMatrix feasible(2);
  feasible.Set(0, 1);
  const std::vector<CameraGeometry> cameras =
      CameraGeometries({CameraLookingAt({0, 0, 0}, {0, 10, 0}), CameraLookingAt({100, 0, 0}, {100, 10, 0})});
  EXPECT_TRUE(FindOverlaps(cameras, ProbesFromDepths(cameras, {1, 1}), feasible, {}, pool).Overlap(0, 1));
}

TEST(OverlapGraph, LongStreetsStayQuick) {
  std::vector<Camera> cameras;
  cameras.reserve(10000);
  for (int i = 0; i < 10000; ++i) {
    cameras.push_back(CameraLookingAt({0.5 * i, 0, 0}, {0.5 * i + (i % 3 - 1) * 4, 10, 0}));
  }
  const OverlapGraph overlaps = Overlaps(cameras, 10);
  EXPECT_TRUE(overlaps.Overlap(5000, 5001));
  EXPECT_FALSE(overlaps.Overlap(5000, 6000));
}

}  // namespace
}  // namespace meshwright
