// SPDX-License-Identifier: Apache-2.0
#include "coordinator/incidence/incidence_matrix.h"

#include <random>
#include <set>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace meshwright {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

TEST(IncidenceMatrix, DoesAsASetOfPairsDoes) {
  std::mt19937 generator(1);
  constexpr int kCameras = 12;
  std::uniform_int_distribution<int> any(0, kCameras - 1);
  IncidenceMatrix matrix(kCameras);
  std::set<std::pair<int, int>> bits;
  for (int step = 0; step < 2000; ++step) {
    const int i = any(generator);
    const int j = any(generator);
    if (i == j) {
      if (any(generator) != 0) continue;
      matrix.ClearRow(i);
      std::erase_if(bits, [&](const auto& bit) { return bit.first == i; });
    } else if (any(generator) < kCameras / 2) {
      matrix.Set(i, j);
      bits.insert({i, j});
      bits.insert({j, i});
    } else {
      matrix.Clear(i, j);
      bits.erase({i, j});
      bits.erase({j, i});
    }
    ASSERT_EQ(matrix.CountBits(), static_cast<int64_t>(bits.size()));
    for (int row = 0; row < kCameras; ++row) {
      int sum = 0;
      for (int column = 0; column < kCameras; ++column) {
        ASSERT_EQ(matrix.Get(row, column), bits.contains({row, column}));
        sum += matrix.Get(row, column) ? 1 : 0;
      }
      ASSERT_EQ(matrix.RowSum(row), sum);
    }
  }
}

TEST(IncidenceMatrix, ClearingARowLeavesTheColumn) {
  IncidenceMatrix matrix(3);
  matrix.Set(0, 1);
  matrix.Set(1, 2);
  matrix.ClearRow(1);
  EXPECT_THAT(matrix.Neighbours(1), IsEmpty());
  EXPECT_THAT(matrix.Neighbours(0), ElementsAre(1));
  EXPECT_THAT(matrix.Neighbours(2), ElementsAre(1));
}

}  // namespace
}  // namespace meshwright
