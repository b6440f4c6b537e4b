// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include <absl/status/status.h>

#include "common/base/thread_pool.h"
#include "worker/filtering/surface_estimate.h"
#include "worker/photo_consistency/patch_scorer.h"

namespace meshwright {

// Photometric refinement of the patches that the MRF chose. The paper stops at steps of d_r along the ray; here depth
// is moved to the peak of photo-consistency, and normals follow the refined neighbours.
struct RefinementOptions {
  int rounds = 2;                 // 0 leaves the patches as they are, 0..8
  double first_step_px = 0.5;     // movement in the target with the widest baseline that the first round tries, px, > 0
  double min_view_quality = 0.5;  // a target below this NCC does not vote, -1..1
  double max_view_deficit = 0.25;  // nor one this much below the best target, 0..2
  int window_radius = 2;  // px, of the windows compared, 1..7: grown patches are near the truth, where small windows
                          // lose little and follow the surface better than those of growing
  int slope_radius_steps = 2;      // normals from linked neighbours this near, lattice steps, 1..8
  int smoothing_radius_steps = 2;  // depths are fitted to neighbours this near at most, 0 leaves them, 0..8
  // Less certain depths are dropped, standard deviation in footprints of a pixel, > 0: where there is next to no
  // texture photo-consistency agrees with itself at any depth, and neighbouring views of a dark background confirm each
  // other's inventions.
  double max_uncertainty_px = 2;

  absl::Status Validate() const;
};

// Refines depth, normal and Sigma of every patch in place, by scores of `scorer` (windows of options.window_radius),
// and drops patches whose depth stays uncertain. Returns how many tentative patches were scored.
int64_t RefineSurface(const PatchScorer& scorer, const RefinementOptions& options, SurfaceEstimate& surface,
                      ThreadPool& pool);

}  // namespace meshwright
