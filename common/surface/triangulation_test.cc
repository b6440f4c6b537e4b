// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <set>
#include <utility>

#include <gtest/gtest.h>

#include "common/surface/random_surface_testing.h"
#include "common/surface/triangulation_testing.h"

namespace meshwright {
namespace {

using Edge = std::pair<int32_t, int32_t>;

// How many triangles go from the first to the second corner of each edge.
std::map<Edge, int> DirectedEdges(const std::vector<std::array<int32_t, 3>>& triangles) {
  std::map<Edge, int> edges;
  for (const auto& t : triangles) {
    for (int k = 0; k < 3; ++k) ++edges[{t[k], t[(k + 1) % 3]}];
  }
  return edges;
}

bool Linked(const PatchLattice& surface, int32_t i, int32_t j) {
  const auto [first, second] = std::minmax(i, j);
  const uint8_t link = second == first + 1 ? PatchLattice::kLinkRight : PatchLattice::kLinkDown;
  return (surface.links[static_cast<size_t>(first)] & link) != 0;
}

bool IsLatticeEdge(const PatchLattice& surface, int32_t i, int32_t j) {
  const int columns = surface.lattice.columns;
  return i / columns == j / columns || i % columns == j % columns;
}

int64_t EulerCharacteristic(const std::vector<std::array<int32_t, 3>>& triangles) {
  std::set<int32_t> vertices;
  std::set<Edge> edges;
  for (const auto& t : triangles) {
    for (int k = 0; k < 3; ++k) {
      vertices.insert(t[k]);
      edges.insert(std::minmax(t[k], t[(k + 1) % 3]));
    }
  }
  return static_cast<int64_t>(vertices.size()) - static_cast<int64_t>(edges.size()) +
         static_cast<int64_t>(triangles.size());
}

// Removes the patch of a node and all links to it.
void Remove(PatchLattice& surface, int column, int row) {
  const auto node = static_cast<size_t>(surface.lattice.Index(column, row));
  surface.depth[node] = 0;
  surface.links[node] = 0;
  if (column > 0) surface.links[node - 1] &= ~PatchLattice::kLinkRight;
  if (row > 0) surface.links[node - static_cast<size_t>(surface.lattice.columns)] &= ~PatchLattice::kLinkDown;
}

TEST(TriangulateLattice, FullSurfaceHasTwoTrianglesACell) {
  for (const auto& [columns, rows] : {std::pair{1, 1}, {2, 2}, {1, 7}, {9, 5}}) {
    const PatchLattice surface = RandomSurface(1, SmallCamera(columns, rows), 1, 1, 1);
    EXPECT_EQ(TriangulateLattice(surface).size(), static_cast<size_t>(2 * (columns - 1) * (rows - 1)));
  }
}

TEST(TriangulateLattice, EmptySurfaceAndEmptyLatticeHaveNone) {
  EXPECT_TRUE(TriangulateLattice(PatchLattice::Empty(0, SmallCamera(8, 8), 1)).empty());
  EXPECT_TRUE(TriangulateLattice(PatchLattice()).empty());
}

TEST(TriangulateLattice, LawsHoldOnRandomSurfaces) {
  for (uint32_t seed = 0; seed < 40; ++seed) {
    const double density = 0.5 + 0.0125 * seed;
    const PatchLattice surface = RandomSurface(seed, SmallCamera(23, 17), 1, density, density);
    const auto triangles = TriangulateLattice(surface);
    for (const auto& t : triangles) {
      std::array<Eigen::Vector3d, 3> corners;
      for (int k = 0; k < 3; ++k) {
        ASSERT_TRUE(surface.HasPatch(t[k]));
        corners[k] = surface.Point(t[k] % surface.lattice.columns, t[k] / surface.lattice.columns);
      }
      // Edges along the lattice are linked.
      for (int k = 0; k < 3; ++k) {
        const int32_t next = t[(k + 1) % 3];
        EXPECT_TRUE(!IsLatticeEdge(surface, t[k], next) || Linked(surface, t[k], next));
      }
      // The right-hand normal points to the camera.
      const Eigen::Vector3d normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
      EXPECT_GT(normal.dot(surface.camera.center_in_world() - corners[0]), 0);
    }
    // Manifold and consistently oriented: an edge is used at most once in each direction.
    for (const auto& [edge, uses] : DirectedEdges(triangles)) EXPECT_EQ(uses, 1);
  }
}

// What the header promises, cell by cell: two triangles when four links are there, one when there is a linked corner.
TEST(TriangulateLattice, EveryPatternOfLinksOfACell) {
  for (unsigned pattern = 0; pattern < 16; ++pattern) {
    const bool top = (pattern & 1) != 0;
    const bool left = (pattern & 2) != 0;
    const bool right = (pattern & 4) != 0;
    const bool bottom = (pattern & 8) != 0;
    for (uint32_t seed = 0; seed < 8; ++seed) {
      PatchLattice surface = RandomSurface(seed, SmallCamera(2, 2), 1, 1, 0);
      surface.links[0] =
          static_cast<uint8_t>((top ? PatchLattice::kLinkRight : 0) | (left ? PatchLattice::kLinkDown : 0));
      surface.links[1] = right ? PatchLattice::kLinkDown : 0;
      surface.links[2] = bottom ? PatchLattice::kLinkRight : 0;
      const int links = top + left + right + bottom;
      const bool corner = (top && left) || (top && right) || (bottom && left) || (bottom && right);
      EXPECT_EQ(TriangulateLattice(surface).size(), links == 4 ? 2U : corner ? 1U : 0U) << pattern;
    }
  }
}

TEST(TriangulateLattice, DiagonalOfAFullCellFollowsTheSmallerStepInDepth) {
  PatchLattice surface = RandomSurface(3, SmallCamera(2, 2), 1, 1, 1);
  surface.depth = {1, 2, 3, 1.5F};
  EXPECT_EQ(DirectedEdges(TriangulateLattice(surface)).count({0, 3}), 1);
  surface.depth = {1, 2, 2.25F, 3};
  EXPECT_EQ(DirectedEdges(TriangulateLattice(surface)).count({1, 2}), 1);
}

TEST(TriangulateLattice, EulerCharacteristicCountsHoles) {
  PatchLattice surface = RandomSurface(4, SmallCamera(12, 9), 1, 1, 1);
  EXPECT_EQ(EulerCharacteristic(TriangulateLattice(surface)), 1);
  Remove(surface, 3, 4);
  EXPECT_EQ(EulerCharacteristic(TriangulateLattice(surface)), 0);
  Remove(surface, 8, 4);
  EXPECT_EQ(EulerCharacteristic(TriangulateLattice(surface)), -1);
}

TEST(TriangulateLattice, CutAlongAColumnGivesTwoPieces) {
  PatchLattice surface = RandomSurface(5, SmallCamera(10, 6), 1, 1, 1);
  for (int row = 0; row < 6; ++row) surface.links[surface.lattice.Index(4, row)] &= ~PatchLattice::kLinkRight;
  EXPECT_EQ(EulerCharacteristic(TriangulateLattice(surface)), 2);
  for (const auto& t : TriangulateLattice(surface)) {
    const bool left = t[0] % 10 <= 4;
    for (const int32_t corner : t) EXPECT_EQ(corner % 10 <= 4, left);
  }
}

}  // namespace
}  // namespace meshwright
