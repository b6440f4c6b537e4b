// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "common/base/thread_pool.h"
#include "worker/filtering/surface_estimate.h"
#include "worker/photo_consistency/patch_scorer.h"

namespace meshwright {

// How far the images of one surface lie beside the epipolar lines that the cameras say. Depth moves a patch's image
// along its epipolar line only: what is left across it is the cameras' error, whatever the surface. Squares add up over
// references, so that Rms() of sums is that of all.
struct EpipolarOffsets {
  double sum_of_squares = 0;  // px^2 of the targets, times measurements; what noise adds is taken out
  int64_t measurements = 0;   // one for a patch in a target
};

// Measured on a thin choice of the surface's patches in the targets of their Sigma: photo-consistency is looked at up
// to 3 px across the epipolar line. Single measurements say little (texture, noise); what those of a part of the
// photograph have in common is the cameras'. The same numbers whatever the number of threads.
EpipolarOffsets MeasureEpipolarOffsets(const PatchScorer& scorer, const SurfaceEstimate& surface, ThreadPool& pool);

}  // namespace meshwright
