// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include <absl/status/status.h>

#include "common/base/thread_pool.h"
#include "common/image/color_image.h"
#include "common/surface/patch_lattice.h"
#include "worker/filtering/refinement.h"
#include "worker/filtering/surface_estimate.h"
#include "worker/growing/growing.h"
#include "worker/mrf/solve.h"

namespace meshwright {

// Section 3.7 of Jancosek et al. 2009, "MRF filtering".
struct FilteringOptions {
  double no_patch_cost = 1;             // c0, cost of label 0, >= 0
  double boundary_cost = 1;             // e0, cost of a patch beside a ray without one, >= 0
  double max_plane_distance_steps = 2;  // delta = distance from each other's plane / (this * d_r), at most 1; > 0
  double max_normal_angle_deg = 60;     // neighbouring normals differ by less, degrees, 0..180
  TrwsOptions trws;
  RefinementOptions refinement;

  absl::Status Validate() const;
};

struct FilteringResult {
  SurfaceEstimate surface;
  double energy = 0;       // E of equation 1 at the labelling
  double lower_bound = 0;  // of TRW-S
};

// Minimises the energy of equation 1 over the stacks: one node per ray, label 0 for no patch, one label per patch.
// Neighbours are linked where both keep a patch and their pairwise cost is finite.
FilteringResult FilterPatches(const PatchStacks& stacks, const Camera& reference, const FilteringOptions& options,
                              ThreadPool& pool);

// F_r as it is kept: depth, normal, quality, colour of the reference photograph.
PatchLattice MakeFilteredSurface(const SurfaceEstimate& surface, CameraIndex reference_index, const Camera& reference,
                                 const ColorImage& color);

}  // namespace meshwright
