// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "common/mesh/triangle_mesh.h"

namespace meshwright {

// An edge with two triangles.
struct InnerEdge {
  std::array<uint32_t, 2> vertices;
  std::array<int32_t, 2> faces;  // the smaller number first
};

// Sorted by vertices. An edge with more than two triangles gives one entry for each pair that follows another.
std::vector<InnerEdge> FindInnerEdges(const TriangleMesh& mesh);

}  // namespace meshwright
