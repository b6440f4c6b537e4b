// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/formats/tile_tree.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "common/base/check.h"
#include "common/base/status_macros.h"

namespace meshwright {
namespace {

// Puts two zeros between the low 21 bits.
uint64_t Spread(uint64_t bits) {
  bits = (bits | bits << 32) & 0x001f00000000ffffULL;
  bits = (bits | bits << 16) & 0x001f0000ff0000ffULL;
  bits = (bits | bits << 8) & 0x100f00f00f00f00fULL;
  bits = (bits | bits << 4) & 0x10c30c30c30c30c3ULL;
  return (bits | bits << 2) & 0x1249249249249249ULL;
}

// How many levels two codes of smallest cubes have in common.
int CommonLevels(uint64_t a, uint64_t b) {
  if (a == b) return TileTree::kMaxDepth;
  return TileTree::kMaxDepth - (static_cast<int>(std::bit_width(a ^ b)) + 2) / 3;
}

}  // namespace

absl::StatusOr<TileTree> TileTree::Build(const MeshRows& mesh, size_t max_faces, const std::string& scratch_beside) {
  MW_CHECK(mesh.faces() > 0 && max_faces > 0);
  MW_ASSIGN_OR_RETURN(auto faces, ScratchArray<FaceCode>::Create(mesh.faces(), scratch_beside));
  MW_ASSIGN_OR_RETURN(auto vertices, ScratchArray<uint64_t>::Create(mesh.vertices(), scratch_beside));
  TileTree tree(std::move(faces), std::move(vertices));
  const MeshRows::Bounds bounds = mesh.FindBounds();
  tree.low_ = bounds.low.cast<double>();
  const double extent = (bounds.high.cast<double>() - tree.low_).maxCoeff();
  if (extent > 0) tree.size_ = extent;
  tree.SortFaces(mesh);
  tree.Divide(max_faces);
  return tree;
}

double TileTree::LatticeStep(int depth) const {
  // Faces reach out of their cubes: half of the numbers of 16 bits are for that.
  return std::exp2(std::ceil(std::log2(size_ / (1 << 15))) - depth);
}

TileTree::Code TileTree::CodeOf(const Eigen::Vector3d& x) const {
  constexpr double kCells = 1 << kMaxDepth;
  Code code = 0;
  for (int k = 0; k < 3; ++k) {
    const double cell = std::clamp(std::floor((x[k] - low_[k]) / size_ * kCells), 0.0, kCells - 1);
    code |= Spread(static_cast<uint64_t>(cell)) << k;
  }
  return code;
}

void TileTree::SortFaces(const MeshRows& mesh) {
  const absl::Span<FaceCode> faces = faces_.values();
  const absl::Span<uint64_t> vertices = vertices_.values();
  for (size_t f = 0; f < faces.size(); ++f) {
    const std::array<uint32_t, 3> corners = mesh.Face(f);
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const uint32_t v : corners) sum += mesh.Position(v).cast<double>();
    const Code code = CodeOf(sum / 3);
    faces[f] = {.code = code, .number = f};
    for (const uint32_t v : corners) {
      uint64_t& vertex = vertices[v];
      if (vertex == 0) vertex = code << kDepthBits | (kMaxDepth + 1);
      const int depth = std::min(CommonDepth(v), CommonLevels(vertex >> kDepthBits, code));
      vertex = (vertex & ~kDepthMask) | static_cast<uint64_t>(depth + 1);
    }
  }
  std::sort(faces.begin(), faces.end());
}

void TileTree::Divide(size_t max_faces) {
  const absl::Span<const FaceCode> faces = std::as_const(faces_).values();
  tiles_.push_back({.name = "r", .depth = 0, .begin = 0, .end = faces.size(), .children = {}});
  for (size_t t = 0; t < tiles_.size(); ++t) {
    const Tile tile = tiles_[t];
    if (tile.end - tile.begin <= max_faces || tile.depth == kMaxDepth) continue;
    const int shift = 3 * (kMaxDepth - tile.depth - 1);
    for (size_t begin = tile.begin; begin < tile.end;) {
      const Code octant = faces[begin].code >> shift;
      const auto* const end = std::partition_point(faces.begin() + begin, faces.begin() + tile.end,
                                                   [&](const FaceCode& face) { return face.code >> shift == octant; });
      tiles_[t].children.push_back(tiles_.size());
      tiles_.push_back({.name = tile.name + static_cast<char>('0' + octant % 8),
                        .depth = tile.depth + 1,
                        .begin = begin,
                        .end = static_cast<size_t>(end - faces.begin()),
                        .children = {}});
      begin = tiles_.back().end;
    }
  }
}

}  // namespace meshwright
