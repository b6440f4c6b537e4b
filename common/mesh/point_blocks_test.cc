// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/point_blocks.h"

#include <algorithm>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace meshwright {
namespace {

TEST(PointBlocks, EachPointIsInOneBlockAndFoundWhereItLies) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> along(0, 1);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 1500; ++i) points.emplace_back(5 * along(random), along(random), 0.1 * along(random));
  // Some lie on each other, so that no plane parts them.
  for (int i = 0; i < 200; ++i) points.emplace_back(1, 0.5, 0);
  const auto count = static_cast<int32_t>(points.size());
  const PointBlocks blocks(
      count, [&](int32_t i) { return points[static_cast<size_t>(i)]; }, 100, "");
  std::vector<int> times(points.size(), 0);
  size_t large = 0;
  for (const PointBlocks::Block& block : blocks.blocks()) {
    const auto members = blocks.Points(block);
    EXPECT_TRUE(std::is_sorted(members.begin(), members.end()));
    large += members.size() > 100 ? 1 : 0;
    for (const int32_t i : members) {
      ++times[static_cast<size_t>(i)];
      EXPECT_TRUE(block.Contains(points[static_cast<size_t>(i)]));
      EXPECT_TRUE(block.around_points.contains(points[static_cast<size_t>(i)]));
    }
    for (const PointBlocks::Block& other : blocks.blocks()) {
      EXPECT_EQ(other.Contains(points[static_cast<size_t>(members.front())]), &other == &block);
    }
  }
  EXPECT_LE(large, 1U) << "only where points lie on each other";
  EXPECT_EQ(std::ranges::count(times, 1), count);

  const Eigen::AlignedBox3d box(Eigen::Vector3d(0.7, 0.2, 0), Eigen::Vector3d(2.1, 0.8, 0.05));
  std::vector<int32_t> inside;
  for (int32_t i = 0; i < count; ++i) {
    if (box.contains(points[static_cast<size_t>(i)])) inside.push_back(i);
  }
  EXPECT_EQ(blocks.PointsIn(box), inside);
}

TEST(PointBlocks, FewPointsAreOneBlockAndNoneAreNone) {
  const auto at = [](int32_t i) { return Eigen::Vector3d(i, 0, 0); };
  EXPECT_EQ(PointBlocks(100, at, 100, "").blocks().size(), 1U);
  EXPECT_EQ(PointBlocks(101, at, 100, "").blocks().size(), 2U);
  EXPECT_TRUE(PointBlocks(0, at, 100, "").blocks().empty());
}

}  // namespace
}  // namespace meshwright
