#include "common/surface/triangulation.h"

#include <cmath>
#include <cstddef>
#include <limits>

#include "common/base/check.h"

namespace meshwright {
namespace {

// One cell of 2 x 2 nodes and the links around it:
//
//   a -- top -- b
//   |           |
//  left       right
//   |           |
//   c - bottom -d
struct Cell {
  int32_t a, b, c, d;
  bool top, left, right, bottom;
};

Cell CellAt(const PatchLattice& surface, int column, int row) {
  const int64_t a = surface.lattice.Index(column, row);
  const int64_t c = surface.lattice.Index(column, row + 1);
  const auto linked = [&](int64_t from, int64_t to, uint8_t link) {
    return (surface.links[static_cast<size_t>(from)] & link) != 0 && surface.HasPatch(from) && surface.HasPatch(to);
  };
  return {.a = static_cast<int32_t>(a),
          .b = static_cast<int32_t>(a + 1),
          .c = static_cast<int32_t>(c),
          .d = static_cast<int32_t>(c + 1),
          .top = linked(a, a + 1, PatchLattice::kLinkRight),
          .left = linked(a, c, PatchLattice::kLinkDown),
          .right = linked(a + 1, c + 1, PatchLattice::kLinkDown),
          .bottom = linked(c, c + 1, PatchLattice::kLinkRight)};
}

}  // namespace

std::vector<std::array<int32_t, 3>> TriangulateLattice(const PatchLattice& surface) {
  const Lattice& lattice = surface.lattice;
  MW_CHECK(lattice.nodes() <= std::numeric_limits<int32_t>::max());
  std::vector<std::array<int32_t, 3>> triangles;
  const auto step_along = [&](int32_t i, int32_t j) {
    return std::abs(surface.depth[static_cast<size_t>(i)] - surface.depth[static_cast<size_t>(j)]);
  };
  for (int row = 0; row + 1 < lattice.rows; ++row) {
    for (int column = 0; column + 1 < lattice.columns; ++column) {
      const auto [a, b, c, d, top, left, right, bottom] = CellAt(surface, column, row);
      // Corners whose two links are there can carry a triangle. Those of b and c need the diagonal a-d, those of a and
      // d the diagonal b-c; triangles over different diagonals would cross.
      const bool over_ad = (top && right) || (left && bottom);
      const bool over_bc = (top && left) || (right && bottom);
      if (!over_ad && !over_bc) continue;
      if (over_ad && (!over_bc || step_along(a, d) <= step_along(b, c))) {
        if (left && bottom) triangles.push_back({a, c, d});
        if (top && right) triangles.push_back({a, d, b});
      } else {
        if (top && left) triangles.push_back({a, c, b});
        if (right && bottom) triangles.push_back({b, c, d});
      }
    }
  }
  return triangles;
}

}  // namespace meshwright
