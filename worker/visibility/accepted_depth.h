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
  std::vector<float> quality;  // photo-consistency of that patch

  static AcceptedDepth Empty(const Camera& reference, int step);
};

// Adds one accepted surface M_i: its triangles are drawn into the reference camera's lattice, the closest kept. Triangles
// that turn away from the reference camera hide nothing and are left out. Surfaces may be added in any order with the
// same result.
void AddAcceptedSurface(const PatchLattice& accepted, const Camera& reference, AcceptedDepth& visible, ThreadPool& pool);

}  // namespace meshwright
