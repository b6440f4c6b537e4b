// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/base/thread_pool.h"
#include "common/surface/patch_lattice.h"
#include "common/surface/sparse_surface.h"

namespace meshwright {

// Which patches of a filtered surface become part of the mesh: section 3.7 ("Meshing") of Jancosek et al. 2009.
struct AcceptanceOptions {
  int k_a = 1;                      // other reference cameras that must agree, >= 1 (the paper: 2 or 3)
  double support_radius_steps = 3;  // radius of agreement in d_r(X), > 0 (section 3.7)

  absl::Status Validate() const;
};

struct AcceptanceResult {
  PatchLattice accepted;  // M_r
  int64_t patches_filtered = 0;
  int64_t patches_accepted = 0;
  int supporters_loaded = 0;
};

// Gives the i-th surface asked for. Whoever calls decides what is kept in memory; acceptance holds one at a time.
using SurfaceLoader = std::function<absl::StatusOr<std::shared_ptr<const SparseSurface>>(int i)>;

// M_r: a patch of F_r is accepted when at least k_a supporters have a filtered patch in the ball of radius
// support_radius_steps * d_r(X) around its centre X. Links stay where both ends do. Errors are the loader's.
//
// A supporter i that sees X coarser than r (d_i > d_r) may have no node in so small a ball although its surface passes
// through it: the radius is taken with d_i instead, but at most 2 d_r, so that a far camera does not support anything
// that lies near.
//
// Ours: a supporter that looks through X, at a surface more than two radii behind it on all four rays around it, speaks
// against the patch; it must have more cameras for it than against it. False surface floats in front of true surface
// that others see, and two wrong cameras that agree by chance are outvoted.
//
// Ours: inferred patches (PatchLattice::IsInferred) are not accepted here, and say neither yes nor no to what was
// measured. They wait until all cameras are there (JudgeAgain).
//
// `supporters` surfaces are asked for in order, each once; the result does not depend on their order.
absl::StatusOr<AcceptanceResult> AcceptSurface(const PatchLattice& filtered, int supporters, const SurfaceLoader& load,
                                               const AcceptanceOptions& options, ThreadPool& pool);

// What a filtered surface comes to once every camera is committed. Its patches lie where all cameras that see them have
// measured them on average.
struct FinalSurface {
  PatchLattice kept;  // M_r less the patches that as many cameras look through as support
  PatchLattice late;  // what of F_r is not in M_r and has found its supporters since, or was inferred by them as well
  // The other patches of F_r, less what was inferred.
  int64_t contradicted = 0;  // at least as many cameras look through them as support them, and at least one does
  int64_t unsupported = 0;   // too few cameras found them, none of them speaks against
};

// Ours: asks all cameras. M_r was accepted by the cameras committed before r; those behind it may look through it, and
// what only they support (all that the first camera of a place saw) was not accepted at all. `supporters` are now all
// that overlap r, `accepted` is M_r. The late patches repeat much of what later cameras were given anyway: they belong
// behind all accepted surfaces, to close gaps.
//
// Each patch moves along its ray to the weighted mean of its own depth and of those at which the supporters' patches
// meet the ray: a weight falls to nothing at the radius of support, and with the square of a supporter's d_s(X) /
// d_r(X). Cameras that are a little wrong, and noise, move each surface in its own way; so parts come to lie on each
// other.
absl::StatusOr<FinalSurface> JudgeAgain(const PatchLattice& filtered, const PatchLattice& accepted, int supporters,
                                        const SurfaceLoader& load, const AcceptanceOptions& options, ThreadPool& pool);

// Removes patches of connected components (by links) with fewer than `min_patches`. Gives the number removed.
int64_t RemoveSmallComponents(int64_t min_patches, PatchLattice& surface);

}  // namespace meshwright
