// SPDX-License-Identifier: Apache-2.0
#include "common/surface/lattice_sight.h"

#include <algorithm>
#include <cstdlib>

#include "common/base/check.h"

namespace meshwright {

LatticeSight::LatticeSight(const Lattice& lattice, const std::vector<uint8_t>& is_marked)
    : lattice_(lattice), distance_(is_marked.size(), 0xFFFF) {
  MW_CHECK(static_cast<int64_t>(is_marked.size()) == lattice.nodes());
  const auto sweep = [&](int column, int row, int direction) {
    const auto i = static_cast<size_t>(lattice_.Index(column, row));
    int distance = is_marked[i] != 0 ? 0 : distance_[i];
    const std::array<std::array<int, 2>, 4> before = {{{-1, 0}, {-1, -1}, {0, -1}, {1, -1}}};
    for (const auto& [dx, dy] : before) {
      if (!lattice_.Contains(column + direction * dx, row + direction * dy)) continue;
      const auto k = static_cast<size_t>(lattice_.Index(column + direction * dx, row + direction * dy));
      distance = std::min(distance, distance_[k] + 1);
    }
    distance_[i] = static_cast<uint16_t>(std::min(distance, 0xFFFF));
  };
  for (int row = 0; row < lattice_.rows; ++row) {
    for (int column = 0; column < lattice_.columns; ++column) sweep(column, row, 1);
  }
  for (int row = lattice_.rows - 1; row >= 0; --row) {
    for (int column = lattice_.columns - 1; column >= 0; --column) sweep(column, row, -1);
  }
}

int LatticeSight::StepsTo(int column, int row, int direction, int reach) const {
  const auto& [dx, dy] = kStep[static_cast<size_t>(direction)];
  const int norm = std::max(std::abs(dx), std::abs(dy));
  for (int steps = 1; steps * norm <= reach;) {
    const int c = column + steps * dx;
    const int r = row + steps * dy;
    if (!lattice_.Contains(c, r)) return 0;
    const int distance = distance_[static_cast<size_t>(lattice_.Index(c, r))];
    if (distance == 0) return steps;
    steps += std::max(1, distance / norm);
  }
  return 0;
}

}  // namespace meshwright
