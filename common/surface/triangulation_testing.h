// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "common/surface/patch_lattice.h"
#include "common/surface/sparse_surface.h"
#include "common/surface/triangulation.h"

namespace meshwright {

// Triangulate() with nodes of the lattice as corners.
inline std::vector<std::array<int32_t, 3>> TriangulateLattice(const PatchLattice& surface) {
  const SparseSurface sparse = SparseSurface::From(surface);
  std::vector<std::array<int32_t, 3>> triangles = Triangulate(sparse);
  for (auto& triangle : triangles) {
    for (int32_t& corner : triangle) corner = sparse.node[static_cast<size_t>(corner)];
  }
  return triangles;
}

}  // namespace meshwright
