// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <absl/status/statusor.h>

#include "common/mesh/formats/mesh_rows.h"
#include "common/mesh/formats/scratch_array.h"

namespace meshwright {

// A cube of an octree, and the faces whose centroids lie in it.
struct Tile {
  std::string name;  // "r", then the octant of each level: x + 2 y + 4 z
  int depth = 0;     // 0: the root
  size_t begin = 0;  // its faces are numbers begin .. end - 1 of the tree's order
  size_t end = 0;
  std::vector<size_t> children;  // octants that have faces; none: a leaf

  bool is_leaf() const { return children.empty(); }
};

// An octree over the faces of a mesh. Memory depends on the number of tiles; what grows with the mesh is in scratch
// files: 16 bytes for each face and 8 for each vertex.
class TileTree {
 public:
  // Cubes with more than `max_faces` faces are divided. The mesh has a face, and outlives the tree.
  static absl::StatusOr<TileTree> Build(const MeshRows& mesh, size_t max_faces, const std::string& scratch_beside);

  // Parents before their children; the first is the root.
  const std::vector<Tile>& tiles() const { return tiles_; }
  // The mesh's face at a place of the order.
  size_t FaceAt(size_t place) const { return faces_.values()[place].number; }
  // Depth of the smallest cube that has all faces of the vertex, which has some. In a tile that is deeper the vertex
  // is on the border to another one.
  int CommonDepth(uint32_t vertex) const { return static_cast<int>(vertices_.values()[vertex] & kDepthMask) - 1; }

  const Eigen::Vector3d& low() const { return low_; }  // corner of the root, less the mesh's offset
  double CubeSize(int depth) const { return std::ldexp(size_, -depth); }

  // Steps of the lattices that compressed positions lie on: a power of two, half as large with each level.
  double LatticeStep(int depth) const;

  static constexpr int kMaxDepth = 19;

 private:
  // Of a smallest cube: three bits for each level, the root's first.
  using Code = uint64_t;
  struct FaceCode {
    Code code;
    uint64_t number;
    friend auto operator<=>(const FaceCode&, const FaceCode&) = default;
  };
  static constexpr int kDepthBits = 7;
  static constexpr uint64_t kDepthMask = (1 << kDepthBits) - 1;

  TileTree(ScratchArray<FaceCode> faces, ScratchArray<uint64_t> vertices)
      : faces_(std::move(faces)), vertices_(std::move(vertices)) {}
  Code CodeOf(const Eigen::Vector3d& x) const;
  void SortFaces(const MeshRows& mesh);
  void Divide(size_t max_faces);

  ScratchArray<FaceCode> faces_;     // by code, then by number
  ScratchArray<uint64_t> vertices_;  // code of the first face, and 1 + the common depth; 0: no face yet
  std::vector<Tile> tiles_;
  Eigen::Vector3d low_;
  double size_ = 1;
};

}  // namespace meshwright
