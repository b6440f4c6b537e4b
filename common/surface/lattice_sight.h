// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "common/surface/lattice.h"

namespace meshwright {

// What lies around a node of a lattice: the nearest marked node in each of sixteen directions.
class LatticeSight {
 public:
  static constexpr int kDirections = 16;
  // Lattice steps, by angle.
  static constexpr std::array<std::array<int, 2>, kDirections> kStep = {{{1, 0},
                                                                         {2, 1},
                                                                         {1, 1},
                                                                         {1, 2},
                                                                         {0, 1},
                                                                         {-1, 2},
                                                                         {-1, 1},
                                                                         {-2, 1},
                                                                         {-1, 0},
                                                                         {-2, -1},
                                                                         {-1, -1},
                                                                         {-1, -2},
                                                                         {0, -1},
                                                                         {1, -2},
                                                                         {1, -1},
                                                                         {2, -1}}};

  // `is_marked`, per node, not 0 for those that are looked for.
  LatticeSight(const Lattice& lattice, const std::vector<uint8_t>& is_marked);

  // After how many of kStep[direction] from the node, at least one, there is a marked one no further than `reach` in
  // the maximum norm; 0: nowhere. What no step can be nearer to than the nearest node of all is stepped over.
  int StepsTo(int column, int row, int direction, int reach) const;

 private:
  Lattice lattice_;
  std::vector<uint16_t> distance_;  // to the nearest marked node, lattice steps in the maximum norm
};

}  // namespace meshwright
