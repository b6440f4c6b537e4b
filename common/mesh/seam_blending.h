// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "common/surface/sparse_surface.h"

namespace meshwright {

// By how much the colour of a patch on a seam has to change to meet the other side half-way.
struct SeamOffset {
  int32_t patch = 0;
  Eigen::Vector3f color = Eigen::Vector3f::Zero();  // grey levels per channel
};

// Carries the offsets from the seam along linked patches, averaged from ring to ring and fading out within `steps`
// rings, into `colors`, which are those of the surface's patches.
void BlendSeams(const std::vector<SeamOffset>& offsets, int steps, const SparseSurface& surface,
                std::vector<std::array<uint8_t, 3>>& colors);

}  // namespace meshwright
