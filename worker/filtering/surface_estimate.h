// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "common/surface/lattice.h"
#include "common/surface/patch_lattice.h"
#include "worker/photo_consistency/patch_scorer.h"

namespace meshwright {

// The surface of one reference camera while it is worked on: at most one patch per ray, in the reference camera's
// terms. Dense arrays over lattice.nodes().
struct SurfaceEstimate {
  Lattice lattice;
  std::vector<PatchPlane> plane;  // w = 0: no patch on this ray
  std::vector<float> quality;     // mean NCC over sigma
  std::vector<uint32_t> sigma;    // bit i: target i sees the patch
  std::vector<uint8_t> links;     // PatchLattice::kLinkRight, kLinkDown

  explicit SurfaceEstimate(const Lattice& over)
      : lattice(over),
        plane(static_cast<size_t>(over.nodes())),
        quality(static_cast<size_t>(over.nodes()), 0.0F),
        sigma(static_cast<size_t>(over.nodes()), 0),
        links(static_cast<size_t>(over.nodes()), 0) {}

  bool HasPatch(int64_t node) const { return plane[static_cast<size_t>(node)].w > 0; }
};

}  // namespace meshwright
