// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <absl/types/span.h>

#include "common/mesh/seam_blending.h"
#include "common/mesh/triangle_mesh.h"
#include "common/surface/sparse_surface.h"

namespace meshwright {

// What joining means for one part. Vertices are those of its PartMesh.
struct PartJoins {
  const uint8_t* small = nullptr;  // per component of the part: to be left out
  std::vector<SeamOffset> offsets = {};
  std::vector<std::pair<uint32_t, uint32_t>> edges =
      {};  // (from, to) of stitches and fillings between its own vertices
};

// One part, ready to be written.
struct FinishedPart {
  TriangleMesh mesh;
  std::vector<int32_t> index;  // of each vertex of the PartMesh in the mesh; -1: left out
  int64_t faces_simplified = 0;
  double area = 0;  // scene units squared
};

// The part, whose patches `trimmed` leaves out, without its small components; colours run into those of its neighbours
// over `blend_steps`, faces are simplified to an error of `simplify_footprints` times the median pixel footprint of its
// vertices (0: not at all). Vertices on the border stay.
FinishedPart FinishPart(const SparseSurface& surface, absl::Span<const uint8_t> trimmed, const PartJoins& joins,
                        int blend_steps, double simplify_footprints);

// Of one triangle, in double.
double TriangleArea(const Eigen::Vector3f& a, const Eigen::Vector3f& b, const Eigen::Vector3f& c);

}  // namespace meshwright
