// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "common/geometry/camera.h"

namespace meshwright {

// d_r(X) of section 3.3 (Jancosek et al. 2009): radius in scene units of the ball at depth `depth` that projects to
// `lattice_step` pixels in `camera`. One lattice step on a surface that faces the camera.
inline double LevelOfDetail(const Camera& camera, double depth, double lattice_step) {
  return lattice_step * depth / camera.focal();
}

}  // namespace meshwright
