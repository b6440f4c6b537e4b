// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "common/base/ids.h"
#include "common/geometry/camera.h"
#include "common/surface/lattice.h"
#include "common/surface/patch_lattice.h"

namespace meshwright {

// A finished surface (F_r or M_r of section 3.7, Jancosek et al. 2009) to be read: what a PatchLattice says, as a list
// of the patches in the order of their nodes. Memory and passes are proportional to the patches, however large the
// photograph: most surfaces of a set of many photographs are nearly empty.
struct SparseSurface {
  CameraIndex camera_index = 0;
  Camera camera;
  Lattice lattice;
  // One entry per patch.
  std::vector<int32_t> node;                     // ascending
  std::vector<float> depth;                      // z in the camera's frame, scene units, > 0
  std::vector<Eigen::Vector3f> normal_in_world;  // unit, towards the camera
  std::vector<float> quality;                    // photo-consistency, in [-1, 1]
  std::vector<std::array<uint8_t, 3>> rgb;       // the reference photograph at the node
  std::vector<uint8_t> links;                    // PatchLattice::kLinkRight, kLinkDown

  static SparseSurface From(const PatchLattice& surface);
  PatchLattice ToLattice() const;

  size_t patches() const { return node.size(); }
  bool IsInferred(size_t patch) const { return quality[patch] == PatchLattice::kInferredQuality; }
  int Column(size_t patch) const { return node[patch] % lattice.columns; }
  int Row(size_t patch) const { return node[patch] / lattice.columns; }
  // Centre X of the patch in world coordinates.
  Eigen::Vector3d Point(size_t patch) const {
    const Eigen::Vector2d pixel = lattice.Pixel(Column(patch), Row(patch));
    return camera.BackProject(pixel.x(), pixel.y(), depth[patch]);
  }
  int64_t bytes() const;
};

// Finds the patches of a surface by their nodes in constant time. Takes 16 bytes for 64 nodes.
class PatchFinder {
 public:
  static constexpr int32_t kNone = -1;

  explicit PatchFinder(const SparseSurface& surface);

  // The patch on a node of the lattice, or kNone.
  int32_t At(int64_t node) const {
    const Word& word = words_[static_cast<size_t>(node) / 64];
    const uint64_t bit = uint64_t{1} << (node % 64);
    return (word.nodes & bit) != 0 ? word.first + std::popcount(word.nodes & (bit - 1)) : kNone;
  }
  // The first patch on this node or behind it; the number of patches when there is none. 0 <= node <= nodes.
  int32_t FirstFrom(int64_t node) const {
    const Word& word = words_[static_cast<size_t>(node) / 64];
    return word.first + std::popcount(word.nodes & ((uint64_t{1} << (node % 64)) - 1));
  }

 private:
  struct Word {
    uint64_t nodes = 0;  // bit per node: it has a patch
    int32_t first = 0;   // patches before
  };
  std::vector<Word> words_;
};

}  // namespace meshwright
