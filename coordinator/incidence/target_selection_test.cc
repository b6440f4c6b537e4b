// SPDX-License-Identifier: Apache-2.0
#include "coordinator/incidence/target_selection.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "coordinator/incidence/cameras_testing.h"

namespace meshwright {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

// Cameras at these angles about the origin, at distance 5.
std::vector<CameraGeometry> CamerasAt(const std::vector<double>& angles_deg) {
  std::vector<Camera> cameras;
  for (const double angle_deg : angles_deg) {
    const double angle = angle_deg * std::numbers::pi / 180;
    cameras.push_back(CameraLookingAt({5 * std::cos(angle), 5 * std::sin(angle), 0}, {0, 0, 0}));
  }
  return CameraGeometries(cameras);
}

std::vector<CameraIndex> Choose(const std::vector<CameraGeometry>& cameras, const std::vector<CameraIndex>& neighbours,
                                int max_targets) {
  const auto probes = ProbesFromDepths(cameras, std::vector<double>(cameras.size(), 5));
  return ChooseTargets(0, neighbours, cameras, probes, {.max_targets = max_targets});
}

TEST(TargetSelection, PrefersMiddlingAngles) {
  EXPECT_THAT(Choose(CamerasAt({0, 2, 48, 15}), {1, 2, 3}, 1), ElementsAre(3));
}

TEST(TargetSelection, LooksFromBothSides) {
  const std::vector<CameraIndex> targets = Choose(CamerasAt({0, 14, 15, 16, -16}), {1, 2, 3, 4}, 2);
  ASSERT_EQ(targets.size(), 2U);
  EXPECT_TRUE(std::find(targets.begin(), targets.end(), 4) != targets.end());
}

TEST(TargetSelection, TakesAllWhenThereAreFew) {
  EXPECT_THAT(Choose(CamerasAt({0, 14, 30}), {1, 2}, 8), ::testing::UnorderedElementsAre(1, 2));
  EXPECT_THAT(Choose(CamerasAt({0, 14}), {}, 8), IsEmpty());
}

TEST(TargetSelection, TiesGoToTheLowestIndexWhateverTheOrderOfNeighbours) {
  const std::vector<CameraGeometry> cameras = CamerasAt({0, 15, 15, 15});
  EXPECT_THAT(Choose(cameras, {1, 2, 3}, 1), ElementsAre(1));
  EXPECT_THAT(Choose(cameras, {3, 2, 1}, 1), ElementsAre(1));
}

TEST(TargetSelection, FirstOnesAreTheSameForAnyLimit) {
  std::vector<double> angles;
  angles.reserve(30);
  std::vector<CameraIndex> neighbours(29);
  for (int i = 0; i < 30; ++i) angles.push_back(i == 0 ? 0 : 3.0 * (i - 15) + 0.1 * i);
  std::iota(neighbours.begin(), neighbours.end(), 1);
  const std::vector<CameraGeometry> cameras = CamerasAt(angles);
  const std::vector<CameraIndex> many = Choose(cameras, neighbours, 12);
  const std::vector<CameraIndex> few = Choose(cameras, neighbours, 5);
  EXPECT_EQ(few, std::vector<CameraIndex>(many.begin(), many.begin() + 5));
}

}  // namespace
}  // namespace meshwright
