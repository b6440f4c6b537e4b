// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/status.h>

#include "common/mesh/triangle_mesh.h"
#include "common/surface/sparse_surface.h"

namespace meshwright {

// One accepted surface M_r (section 3.7, Jancosek et al. 2009) as a mesh with all attributes per vertex: one vertex per
// patch that belongs to a triangle, in the order of the lattice; other patches are left out.
TriangleMesh MeshOfSurface(const SparseSurface& surface);
inline TriangleMesh MeshOfSurface(const PatchLattice& surface) { return MeshOfSurface(SparseSurface::From(surface)); }

// Writes one surface as a PLY file of its own.
absl::Status WriteSurfacePart(const SparseSurface& surface, const Eigen::Vector3d& offset, const std::string& path);
inline absl::Status WriteSurfacePart(const PatchLattice& surface, const Eigen::Vector3d& offset,
                                     const std::string& path) {
  return WriteSurfacePart(SparseSurface::From(surface), offset, path);
}

}  // namespace meshwright
