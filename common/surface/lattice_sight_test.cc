// SPDX-License-Identifier: Apache-2.0
#include "common/surface/lattice_sight.h"

#include <random>

#include <gtest/gtest.h>

namespace meshwright {
namespace {

// Looks at every step on the way.
int SlowStepsTo(const Lattice& lattice, const std::vector<uint8_t>& is_marked, int column, int row, int direction,
                int reach) {
  const auto& [dx, dy] = LatticeSight::kStep[static_cast<size_t>(direction)];
  const int norm = std::max(std::abs(dx), std::abs(dy));
  for (int steps = 1; steps * norm <= reach; ++steps) {
    if (!lattice.Contains(column + steps * dx, row + steps * dy)) return 0;
    if (is_marked[static_cast<size_t>(lattice.Index(column + steps * dx, row + steps * dy))] != 0) return steps;
  }
  return 0;
}

TEST(LatticeSight, FindsWhatEveryStepOfTheWayWouldFind) {
  const Lattice lattice{2, 61, 43};
  std::mt19937 random(3);
  for (const double share : {0.0, 0.002, 0.02, 0.3}) {
    std::vector<uint8_t> is_marked(static_cast<size_t>(lattice.nodes()), 0);
    for (uint8_t& marked : is_marked) marked = std::uniform_real_distribution<>(0, 1)(random) < share ? 1 : 0;
    const LatticeSight sight(lattice, is_marked);
    for (int row = 0; row < lattice.rows; row += 5) {
      for (int column = 0; column < lattice.columns; column += 3) {
        for (int direction = 0; direction < LatticeSight::kDirections; ++direction) {
          for (const int reach : {0, 7, 100}) {
            EXPECT_EQ(sight.StepsTo(column, row, direction, reach),
                      SlowStepsTo(lattice, is_marked, column, row, direction, reach));
          }
        }
      }
    }
  }
}

}  // namespace
}  // namespace meshwright
