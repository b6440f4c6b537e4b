// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include <absl/status/status.h>

#include "common/base/thread_pool.h"
#include "common/surface/lattice.h"
#include "worker/photo_consistency/patch_scorer.h"
#include "worker/seeding/seeding.h"
#include "worker/visibility/accepted_depth.h"

namespace meshwright {

// Section 3.6 of Jancosek et al. 2009.
struct GrowingOptions {
  double min_quality = 0.4;          // condition (2): q of a grown patch, -1..1 (the paper: 0.6 with unweighted NCC)
  double max_quality_deficit = 0.1;  // condition (2): q may be this much below the best on its ray, 0..2
  int max_patches_per_ray = 10;      // condition (5), 1..32
  double normal_radius_steps = 10;   // normals from patches of the same seed this near, lattice steps, 1..16

  absl::Status Validate() const;
};

// A patch on a ray of the reference lattice: p = (X, n, r, Sigma) with the bookkeeping of growing.
struct GrownPatch {
  PatchPlane plane;    // inverse depth on the node's ray and its slope (the normal)
  float quality = 0;   // q(p), mean NCC over sigma
  uint32_t sigma = 0;  // Sigma: bit i = target i
  int32_t seed = 0;    // which seed it grew from
  int32_t node = 0;    // lattice index
  int32_t next = -1;   // next patch on the same ray, -1 at the end
};

// G_r: the stack of grown patches on every ray.
struct PatchStacks {
  Lattice lattice;
  std::vector<int32_t> first;       // per node: index into `patches`, -1 for none
  std::vector<GrownPatch> patches;  // in order of insertion
  int64_t tentative_patches_scored = 0;

  int64_t CountRays() const;
};

// Grows the seeds over the surface, best quality first, until nothing more passes the tests. Patches are taken from the
// queue in batches of a fixed size, scored in parallel and inserted in order: the result does not depend on the number
// of threads.
//
// Ours: a patch keeps the targets that its seed had (Sigma) as long as they agree; where they do not, growing goes on
// in other targets, when at least two agree well.
PatchStacks Grow(const PatchScorer& scorer, const std::vector<Seed>& seeds, const AcceptedDepth& accepted,
                 const GrowingOptions& options, ThreadPool& pool);

// Level of detail in inverse depth: half-width of [w - x, w + x] that one step d_r along the ray spans around inverse
// depth w. A step of d_r = step * z / f changes 1/z by w * step / f, to first order.
float InverseDepthStep(const Camera& reference, int lattice_step, float inverse_depth);

}  // namespace meshwright
