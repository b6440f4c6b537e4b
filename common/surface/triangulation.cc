// SPDX-License-Identifier: Apache-2.0
#include "common/surface/triangulation.h"

#include <cmath>
#include <cstddef>

namespace meshwright {
namespace {

using Triangles = std::vector<std::array<int32_t, 3>>;

constexpr int32_t kNone = -1;

// The patches of one cell of 2 x 2 nodes, kNone where there is none, and the links around it:
//
//   a -- top -- b
//   |           |
//  left       right
//   |           |
//   c - bottom -d
struct Cell {
  int32_t a, b, c, d;
};

void TriangulateCell(const SparseSurface& surface, const Cell& cell, Triangles& triangles) {
  const auto [a, b, c, d] = cell;
  const auto linked = [&](int32_t from, int32_t to, uint8_t link) {
    return from != kNone && to != kNone && (surface.links[static_cast<size_t>(from)] & link) != 0;
  };
  const bool top = linked(a, b, PatchLattice::kLinkRight);
  const bool left = linked(a, c, PatchLattice::kLinkDown);
  const bool right = linked(b, d, PatchLattice::kLinkDown);
  const bool bottom = linked(c, d, PatchLattice::kLinkRight);
  // Corners whose two links are there can carry a triangle. Those of b and c need the diagonal a-d, those of a and d
  // the diagonal b-c; triangles over different diagonals would cross.
  const bool over_ad = (top && right) || (left && bottom);
  const bool over_bc = (top && left) || (right && bottom);
  if (!over_ad && !over_bc) return;
  const auto step_along = [&](int32_t i, int32_t j) {
    return std::abs(surface.depth[static_cast<size_t>(i)] - surface.depth[static_cast<size_t>(j)]);
  };
  if (over_ad && (!over_bc || step_along(a, d) <= step_along(b, c))) {
    if (left && bottom) triangles.push_back({a, c, d});
    if (top && right) triangles.push_back({a, d, b});
  } else {
    if (top && left) triangles.push_back({a, c, b});
    if (right && bottom) triangles.push_back({b, c, d});
  }
}

}  // namespace

std::vector<std::array<int32_t, 3>> Triangulate(const SparseSurface& surface) {
  Triangles triangles;
  triangles.reserve(2 * surface.patches());
  const auto patches = static_cast<int32_t>(surface.patches());
  const int32_t columns = surface.lattice.columns;
  const auto node_of = [&](int32_t patch) { return surface.node[static_cast<size_t>(patch)]; };
  int32_t below = 0;  // the first patch at or behind the node below the one before `patch`
  for (int32_t patch = 0; patch < patches; ++patch) {
    const int32_t node = node_of(patch);
    const int32_t column = node % columns;
    while (below < patches && node_of(below) < node + columns - 1) ++below;
    // The patches below the node before this one, this one and the next one.
    std::array<int32_t, 3> under = {kNone, kNone, kNone};
    for (int32_t at = below; at < patches && node_of(at) <= node + columns + 1; ++at) {
      under[static_cast<size_t>(node_of(at) - (node + columns - 1))] = at;
    }
    // A cell belongs to its upper left corner; where that is empty, to the upper right one.
    const bool has_left = patch > 0 && node_of(patch - 1) == node - 1;
    if (column > 0 && !has_left) TriangulateCell(surface, {kNone, patch, under[0], under[1]}, triangles);
    if (column + 1 < columns) {
      const bool has_right = patch + 1 < patches && node_of(patch + 1) == node + 1;
      TriangulateCell(surface, {patch, has_right ? patch + 1 : kNone, under[1], under[2]}, triangles);
    }
  }
  return triangles;
}

}  // namespace meshwright
