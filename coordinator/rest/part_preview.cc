// SPDX-License-Identifier: Apache-2.0
#include "coordinator/rest/part_preview.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "common/base/little_endian.h"
#include "common/mesh/disjoint_sets.h"
#include "common/surface/triangulation.h"

namespace meshwright {
namespace {

using Triangles = std::vector<std::array<int32_t, 3>>;

constexpr uint32_t kVersion = 1;
// Patches whose depths differ by more than this many lattice steps per step are on either side of a depth step.
constexpr double kMaxSlope = 6;

// Which patches hang together over links.
std::vector<int32_t> FindPieces(const SparseSurface& surface) {
  const PatchFinder finder(surface);
  const int32_t columns = surface.lattice.columns;
  DisjointSets sets(surface.patches());
  for (size_t i = 0; i < surface.patches(); ++i) {
    const auto join = [&](int64_t node) {
      const int32_t other = node < surface.lattice.nodes() ? finder.At(node) : PatchFinder::kNone;
      if (other != PatchFinder::kNone) sets.Join(static_cast<int32_t>(i), other);
    };
    if ((surface.links[i] & PatchLattice::kLinkRight) != 0 && surface.Column(i) + 1 < columns) {
      join(surface.node[i] + 1);
    }
    if ((surface.links[i] & PatchLattice::kLinkDown) != 0) join(int64_t{surface.node[i]} + columns);
  }
  std::vector<int32_t> pieces(surface.patches());
  for (size_t i = 0; i < pieces.size(); ++i) pieces[i] = sets.Root(static_cast<int32_t>(i));
  return pieces;
}

// The patch that each block of stride x stride nodes stands for: a surface on the lattice of blocks, and which patch of
// the whole surface each of its patches is.
struct Blocks {
  SparseSurface surface;
  std::vector<int32_t> patch;
};

Blocks ChoosePatches(const SparseSurface& surface, int32_t stride) {
  Blocks blocks;
  blocks.surface.lattice = surface.lattice;
  blocks.surface.lattice.columns = (surface.lattice.columns + stride - 1) / stride;
  blocks.surface.lattice.rows = (surface.lattice.rows + stride - 1) / stride;
  std::vector<int32_t> best(static_cast<size_t>(blocks.surface.lattice.nodes()), PatchFinder::kNone);
  // Twice the distances from the middle, to stay with whole numbers.
  const auto distance = [&](size_t i) {
    const int64_t dx = 2 * (surface.Column(i) % stride) - (stride - 1);
    const int64_t dy = 2 * (surface.Row(i) % stride) - (stride - 1);
    return dx * dx + dy * dy;
  };
  for (size_t i = 0; i < surface.patches(); ++i) {
    const int64_t block = blocks.surface.lattice.Index(surface.Column(i) / stride, surface.Row(i) / stride);
    int32_t& chosen = best[static_cast<size_t>(block)];
    if (chosen == PatchFinder::kNone || distance(i) < distance(static_cast<size_t>(chosen))) {
      chosen = static_cast<int32_t>(i);
    }
  }
  for (size_t block = 0; block < best.size(); ++block) {
    if (best[block] == PatchFinder::kNone) continue;
    blocks.surface.node.push_back(static_cast<int32_t>(block));
    blocks.surface.depth.push_back(surface.depth[static_cast<size_t>(best[block])]);
    blocks.patch.push_back(best[block]);
  }
  blocks.surface.links.assign(blocks.patch.size(), 0);
  return blocks;
}

void LinkBlocks(const SparseSurface& surface, const std::vector<int32_t>& pieces, int32_t stride, Blocks& blocks) {
  const PatchFinder finder(blocks.surface);
  const auto linked = [&](size_t i, int64_t node) {
    const int32_t other = node < blocks.surface.lattice.nodes() ? finder.At(node) : PatchFinder::kNone;
    if (other == PatchFinder::kNone) return false;
    const auto j = static_cast<size_t>(other);
    if (pieces[static_cast<size_t>(blocks.patch[i])] != pieces[static_cast<size_t>(blocks.patch[j])]) return false;
    const double nearer = std::min(blocks.surface.depth[i], blocks.surface.depth[j]);
    const double step = surface.lattice.step * nearer / surface.camera.focal();
    return std::abs(blocks.surface.depth[i] - blocks.surface.depth[j]) <= kMaxSlope * stride * step;
  };
  const int32_t columns = blocks.surface.lattice.columns;
  for (size_t i = 0; i < blocks.patch.size(); ++i) {
    const int64_t node = blocks.surface.node[i];
    if (blocks.surface.Column(i) + 1 < columns && linked(i, node + 1)) {
      blocks.surface.links[i] |= PatchLattice::kLinkRight;
    }
    if (linked(i, node + columns)) blocks.surface.links[i] |= PatchLattice::kLinkDown;
  }
}

Triangles TriangulateCoarsely(const SparseSurface& surface, const std::vector<int32_t>& pieces, int32_t stride) {
  Blocks blocks = ChoosePatches(surface, stride);
  LinkBlocks(surface, pieces, stride, blocks);
  Triangles triangles = Triangulate(blocks.surface);
  for (auto& triangle : triangles) {
    for (int32_t& corner : triangle) corner = blocks.patch[static_cast<size_t>(corner)];
  }
  return triangles;
}

struct Preview {
  int32_t stride = 1;
  int64_t faces_of_surface = 0;
  Triangles triangles;  // corners are patches
};

Preview Simplify(const SparseSurface& surface, int64_t max_faces) {
  Preview preview;
  preview.triangles = Triangulate(surface);
  preview.faces_of_surface = static_cast<int64_t>(preview.triangles.size());
  if (preview.faces_of_surface <= max_faces) return preview;
  const double ratio = static_cast<double>(preview.faces_of_surface) / static_cast<double>(max_faces);
  const std::vector<int32_t> pieces = FindPieces(surface);
  preview.stride = std::max(2, static_cast<int32_t>(std::sqrt(ratio)));
  // A stride as wide as the lattice leaves one block, and so no triangle.
  while (true) {
    preview.triangles = TriangulateCoarsely(surface, pieces, preview.stride);
    if (static_cast<int64_t>(preview.triangles.size()) <= max_faces) return preview;
    ++preview.stride;
  }
}

}  // namespace

std::string MakePartPreview(const SparseSurface& surface, int32_t sequence, int64_t max_faces) {
  Preview preview = Simplify(surface, max_faces);
  std::vector<int32_t> vertex_of_patch(surface.patches(), -1);
  for (const auto& triangle : preview.triangles) {
    for (const int32_t corner : triangle) vertex_of_patch[static_cast<size_t>(corner)] = 0;
  }
  std::vector<size_t> patches;
  Eigen::Vector3f smallest = Eigen::Vector3f::Zero();
  Eigen::Vector3f largest = Eigen::Vector3f::Zero();
  std::string positions;
  for (size_t i = 0; i < vertex_of_patch.size(); ++i) {
    if (vertex_of_patch[i] < 0) continue;
    vertex_of_patch[i] = static_cast<int32_t>(patches.size());
    const Eigen::Vector3f x_in_world = surface.Point(i).cast<float>();
    smallest = patches.empty() ? x_in_world : smallest.cwiseMin(x_in_world).eval();
    largest = patches.empty() ? x_in_world : largest.cwiseMax(x_in_world).eval();
    patches.push_back(i);
    for (int k = 0; k < 3; ++k) AppendLittleEndian(x_in_world[k], positions);
  }

  std::string out = "MWPV";
  for (const int64_t value :
       {int64_t{kVersion}, int64_t{sequence}, int64_t{surface.camera_index}, static_cast<int64_t>(patches.size()),
        static_cast<int64_t>(preview.triangles.size()), int64_t{preview.stride}, preview.faces_of_surface}) {
    AppendLittleEndian(static_cast<uint32_t>(value), out);
  }
  for (int k = 0; k < 3; ++k) AppendLittleEndian(smallest[k], out);
  for (int k = 0; k < 3; ++k) AppendLittleEndian(largest[k], out);
  out += positions;
  for (const size_t i : patches) {
    for (const uint8_t channel : surface.rgb[i]) out.push_back(static_cast<char>(channel));
  }
  out.resize((out.size() + 3) / 4 * 4, '\0');
  for (const auto& triangle : preview.triangles) {
    for (const int32_t corner : triangle) {
      AppendLittleEndian(static_cast<uint32_t>(vertex_of_patch[static_cast<size_t>(corner)]), out);
    }
  }
  return out;
}

}  // namespace meshwright
