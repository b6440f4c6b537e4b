// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include <absl/status/status.h>

#include "common/base/thread_pool.h"
#include "worker/filtering/surface_estimate.h"
#include "worker/photo_consistency/patch_scorer.h"
#include "worker/visibility/accepted_depth.h"

namespace meshwright {

// Ours, after the planar priors of ACMP (Xu and Tao 2020) and TAPA-MVS (Romanoni and Matteucci 2019).
struct CompletionOptions {
  // How far from a ray the surface around it may lie, as a share of the lattice's longer side, 0..1; 0: nothing is
  // inferred.
  double max_reach = 0.33;

  absl::Status Validate() const;
};

// Infers the surface where windows show next to nothing to compare (plain walls, doors, panels): a ray without a patch
// looks around itself in sixteen directions for the nearest surface, found here or accepted before; where most of what
// it meets lies on one plane, it gets the patch of that plane. So holes close that a plane surrounds, and nothing is
// extended beyond a rim.
//
// An inferred patch has quality 0 and Sigma empty; acceptance asks for another camera that finds the same, gives it no
// say about what was measured, and puts it behind all that was (AcceptSurface, JudgeAgain). Returns how many there are.
//
// `found`, per node, w = 0 for none: planes that are known otherwise and no better (GrowOnSmallerPhotographs). They
// come first, and are no surface that anything is inferred from.
int64_t CompleteSurface(const PatchScorer& scorer, const AcceptedDepth& accepted, const std::vector<PatchPlane>& found,
                        const CompletionOptions& options, SurfaceEstimate& surface, ThreadPool& pool);

}  // namespace meshwright
