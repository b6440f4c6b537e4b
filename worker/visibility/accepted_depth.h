// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "common/base/thread_pool.h"
#include "common/geometry/camera.h"
#include "common/surface/lattice.h"
#include "common/surface/sparse_surface.h"

namespace meshwright {

// The buffer V_r of section 3.4 (Jancosek et al. 2009): per ray of the reference camera's lattice the closest accepted
// patch that the camera sees. Nothing behind it is processed.
struct AcceptedDepth {
  Lattice lattice;
  std::vector<float> depth;    // z in the reference camera's frame, scene units; 0 = nothing accepted on this ray
  std::vector<float> quality;  // photo-consistency of that patch, 0 where nothing is accepted

  static AcceptedDepth Empty(const Camera& reference, int step);
};

// Draws accepted surfaces M_i into a reference camera's lattice: of all their triangles the closest on each ray is kept
// (of two at the same depth the one of higher quality). Surfaces may be added in any order, by any number of threads at
// the same time, with the same result.
//
// Left out: triangles that turn away from the reference camera (they hide nothing), triangles with a corner that is not
// in front of it, and patches that belong to no triangle: these are not part of the mesh, so that a ray behind one must
// still be processed.
class AcceptedDepthBuffer {
 public:
  AcceptedDepthBuffer(const Camera& reference, int step);

  void Add(const SparseSurface& accepted, ThreadPool& pool);

  // Once all are added.
  AcceptedDepth Depth() const;

 private:
  // (depth, quality) in one number that is smaller when the depth is smaller, or equal and the quality higher. The
  // least of a set of such numbers does not depend on the order in which threads bring them.
  using Key = uint64_t;

  const Camera reference_;
  const Lattice lattice_;
  std::vector<Key> keys_;
};

}  // namespace meshwright
