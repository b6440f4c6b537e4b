// SPDX-License-Identifier: Apache-2.0
#include "common/surface/sparse_surface.h"

#include <limits>

#include "common/base/check.h"

namespace meshwright {

SparseSurface SparseSurface::From(const PatchLattice& surface) {
  MW_CHECK(surface.lattice.nodes() <= std::numeric_limits<int32_t>::max());
  SparseSurface sparse{.camera_index = surface.camera_index, .camera = surface.camera, .lattice = surface.lattice};
  const auto patches = static_cast<size_t>(surface.CountPatches());
  sparse.node.reserve(patches);
  sparse.depth.reserve(patches);
  sparse.normal_in_world.reserve(patches);
  sparse.quality.reserve(patches);
  sparse.rgb.reserve(patches);
  sparse.links.reserve(patches);
  for (size_t node = 0; node < surface.depth.size(); ++node) {
    if (!surface.HasPatch(static_cast<int64_t>(node))) continue;
    sparse.node.push_back(static_cast<int32_t>(node));
    sparse.depth.push_back(surface.depth[node]);
    sparse.normal_in_world.push_back(surface.normal_in_world[node]);
    sparse.quality.push_back(surface.quality[node]);
    sparse.rgb.push_back(surface.rgb[node]);
    sparse.links.push_back(surface.links[node]);
  }
  return sparse;
}

PatchLattice SparseSurface::ToLattice() const {
  PatchLattice surface = PatchLattice::Empty(camera_index, camera, lattice.step);
  for (size_t patch = 0; patch < patches(); ++patch) {
    const auto at = static_cast<size_t>(node[patch]);
    surface.depth[at] = depth[patch];
    surface.normal_in_world[at] = normal_in_world[patch];
    surface.quality[at] = quality[patch];
    surface.rgb[at] = rgb[patch];
    surface.links[at] = links[patch];
  }
  return surface;
}

int64_t SparseSurface::bytes() const {
  constexpr size_t kPatchBytes = sizeof(int32_t) + 2 * sizeof(float) + sizeof(Eigen::Vector3f) + 3 + 1;
  return static_cast<int64_t>(sizeof(SparseSurface) + patches() * kPatchBytes);
}

PatchFinder::PatchFinder(const SparseSurface& surface) : words_(static_cast<size_t>(surface.lattice.nodes()) / 64 + 1) {
  for (const int32_t node : surface.node) {
    words_[static_cast<size_t>(node) / 64].nodes |= uint64_t{1} << (node % 64);
  }
  int32_t patches = 0;
  for (Word& word : words_) {
    word.first = patches;
    patches += std::popcount(word.nodes);
  }
}

}  // namespace meshwright
