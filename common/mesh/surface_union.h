#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/mesh/triangle_mesh.h"
#include "common/surface/patch_lattice.h"

namespace meshwright {

// One accepted surface M_r (section 3.7, Jancosek et al. 2009) as a mesh with all attributes per vertex: one vertex per
// patch that belongs to a triangle, in the order of the lattice; other patches are left out.
TriangleMesh MeshOfSurface(const PatchLattice& surface);

struct SurfaceUnionCounts {
  int64_t vertices = 0;
  int64_t faces = 0;
};

// Gives surface `index` of those that make up the mesh.
using LoadSurface = std::function<absl::StatusOr<PatchLattice>(int64_t index)>;

// Writes the union of surfaces 0 .. count - 1 as one PLY file; the parts are laid side by side in this order, not
// stitched. Loads one surface at a time and forgets it, so memory depends on the largest one only. Errors: those of
// `load`, or of PlyStreamWriter; then no file appears.
absl::StatusOr<SurfaceUnionCounts> WriteSurfaceUnion(int64_t count, const LoadSurface& load, const std::string& path);

// Writes one surface as a PLY file of its own.
absl::Status WriteSurfacePart(const PatchLattice& surface, const std::string& path);

}  // namespace meshwright
