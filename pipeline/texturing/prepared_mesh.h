// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "common/geometry/camera.h"
#include "common/mesh/triangle_mesh.h"

namespace meshwright {

// Median over the mesh of the smallest pixel footprint z / f (scene units) that a camera whose image holds the vertex
// has there; 0 when no camera sees any.
double MedianFootprint(const TriangleMesh& mesh, const std::vector<Camera>& cameras);

// The mesh that gets the texture: simplified up to `max_error` (scene units; 0: as it is), then no edge longer than
// `max_edge`, so that a triangle fits into photographs; without vertices that no face has. Positions and colours only.
TriangleMesh PrepareMesh(TriangleMesh mesh, double max_error, double max_edge);

}  // namespace meshwright
