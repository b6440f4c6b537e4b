#pragma once

#include <vector>

#include "common/base/thread_pool.h"
#include "common/geometry/camera.h"
#include "common/surface/lattice.h"
#include "common/surface/patch_lattice.h"

namespace meshwright {

// The buffer V_r of section 3.4 (Jancosek et al. 2009): per ray of the reference camera's lattice the closest accepted
// patch that the camera sees. Nothing behind it is processed.
struct AcceptedDepth {
  Lattice lattice;
  std::vector<float> depth;    // z in the reference camera's frame, scene units; 0 = nothing accepted on this ray
  std::vector<float> quality;  // photo-consistency of that patch, 0 where nothing is accepted

  static AcceptedDepth Empty(const Camera& reference, int step);
};

// Adds one accepted surface M_i: its triangles are drawn into the reference camera's lattice, the closest kept (of two
// at the same depth the one of higher quality). Surfaces may be added in any order, with any number of threads, with
// the same result.
//
// Left out: triangles that turn away from the reference camera (they hide nothing), triangles with a corner that is not
// in front of it, and patches that belong to no triangle: these are not part of the mesh, so that a ray behind one must
// still be processed.
void AddAcceptedSurface(const PatchLattice& accepted, const Camera& reference, AcceptedDepth& visible,
                        ThreadPool& pool);

}  // namespace meshwright
