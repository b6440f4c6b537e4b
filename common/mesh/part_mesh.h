// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "common/surface/sparse_surface.h"

namespace meshwright {

// Triangles of one accepted surface, ready to be joined with others. Every vertex has one fan of triangles around it:
// a patch where several fans meet in a point gives several vertices. Hence borders are simple closed loops.
struct PartMesh {
  static constexpr int32_t kInterior = -1;

  std::vector<int32_t> patch_of_vertex;       // ascending
  std::vector<std::array<int32_t, 3>> faces;  // vertices, counter-clockwise seen from the camera
  std::vector<int32_t> next_on_border;        // per vertex: where the border goes on, the triangle to its left
  std::vector<int32_t> component_of_vertex;   // numbered by their first vertices
  std::vector<int64_t> faces_of_component;
};

// Triangles of the surface that touch no patch that `removed` (one entry per patch) marks.
PartMesh BuildPartMesh(const SparseSurface& surface, const std::vector<uint8_t>& removed);

}  // namespace meshwright
