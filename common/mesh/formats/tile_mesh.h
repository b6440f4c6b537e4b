// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "common/mesh/formats/tile_tree.h"

namespace meshwright {

// What a tile shows: the faces of its cube, or fewer that stand for them.
struct TileMesh {
  static constexpr uint32_t kNoVertex = UINT32_MAX;

  std::vector<Eigen::Vector3f> positions;      // less the mesh's offset
  std::vector<std::array<uint8_t, 3>> colors;  // empty when the mesh has none
  std::vector<uint32_t> vertices;              // numbers in the mesh; kNoVertex: it stands for several
  std::vector<uint8_t> common_depth;           // TileTree::CommonDepth
  std::vector<std::array<uint32_t, 3>> faces;  // counter-clockwise seen from outside, as the mesh's
  // Bounds of the mesh's faces in the cube.
  Eigen::AlignedBox3d box;
  // No vertex is farther than this from those it stands for; scene units. 0 for a leaf.
  double error = 0;
};

// The faces of a leaf as they are.
TileMesh LeafMesh(const MeshRows& mesh, const TileTree& tree, const Tile& leaf);

// The meshes of a tile's children in one, joined at the vertices that they share, and then, in place of the vertices of
// each cell of a grid, one at their mean (Rossignac and Borrel, 1993). Cells grow until there are at most `max_faces`
// faces. Vertices on the border of the tile stay as they are in the mesh, so that tiles fit together whatever their
// depths: the border may need more faces than that.
TileMesh ParentMesh(const std::vector<TileMesh>& children, const TileTree& tree, const Tile& parent, size_t max_faces);

// Positions on the lattice of the tile (TileTree::LatticeStep), and on the border on that of the coarsest tile that has
// the vertex on its border: the same in all tiles that have it there.
std::vector<Eigen::Vector3f> SnappedPositions(const TileMesh& mesh, const TileTree& tree, const Tile& tile);

}  // namespace meshwright
