#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "common/surface/patch_lattice.h"

namespace meshwright {

// By how much the colour of a node on a seam has to change to meet the other side half-way.
struct SeamOffset {
  int32_t node = 0;
  Eigen::Vector3f color = Eigen::Vector3f::Zero();  // grey levels per channel
};

// Carries the offsets from the seam along linked patches, averaged from ring to ring and fading out within `steps`
// rings, into the surface's colours.
void BlendSeams(const std::vector<SeamOffset>& offsets, int steps, PatchLattice& surface);

}  // namespace meshwright
