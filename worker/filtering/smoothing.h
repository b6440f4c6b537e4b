// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "common/base/thread_pool.h"
#include "worker/filtering/surface_estimate.h"

namespace meshwright {

// Moves every patch along its ray towards the plane that it and its neighbours fit best. Each depth was found from a
// small window, so neighbours carry news of their own. They count by their certainty and, as in a bilateral filter, by
// how well each continues the other's plane: what is further away than the uncertainties explain is another surface.
//
// `uncertainty` is the standard deviation of each patch's depth in pixel footprints, > 0 where there is a patch. Only
// inverse depth changes; a surface that is a plane stays as it is, up to rounding. `focal` is in px; `max_radius` in
// lattice steps, the larger the more uncertain the patch.
void SmoothDepth(const std::vector<float>& uncertainty, double focal, int max_radius, SurfaceEstimate& surface,
                 ThreadPool& pool);

}  // namespace meshwright
