// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "common/base/thread_pool.h"
#include "worker/camera_job/camera_job.h"
#include "worker/filtering/surface_estimate.h"
#include "worker/photo_consistency/patch_scorer.h"

namespace meshwright {

// Ours: what is out of focus, or has too little texture for windows of the full size, may still be compared on the
// photograph halved, and halved again (options.halvings). For the rays that have no patch in `surface` and nothing
// accepted, sections 3.5 to 3.7 are gone through once more on the smaller photographs: seeds are corners, sparse points
// and what borders the hole. Depths have to be more certain there than twice the footprint of a pixel of full size.
//
// Gives for each node of `surface` the plane that was found, w = 0 for none. They are less accurate than the others,
// and reach over silhouettes a little: CompleteSurface makes them patches that have no say. `scored` gets the number of
// tentative patches.
// `scorer`: of `input` at full size.
std::vector<PatchPlane> GrowOnSmallerPhotographs(const CameraJobInput& input, const PatchScorer& scorer,
                                                 const CameraJobOptions& options, const SurfaceEstimate& surface,
                                                 int64_t& scored, ThreadPool& pool);

}  // namespace meshwright
