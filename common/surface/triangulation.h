// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "common/surface/sparse_surface.h"

namespace meshwright {

// Triangles over the patches of a lattice surface (section 3.7: M_r is a triangulated lattice): each cell of 2 x 2
// nodes gives two triangles when its patches are linked all round, one when three of them are linked in a corner.
// Corners are patches, counter-clockwise as seen from the camera (so that the right-hand normal points to it). The
// diagonal of a full cell joins the pair of corners with the smaller difference in depth.
std::vector<std::array<int32_t, 3>> Triangulate(const SparseSurface& surface);
}  // namespace meshwright
