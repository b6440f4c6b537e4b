// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "common/geometry/camera.h"
#include "common/geometry/lens.h"

namespace meshwright {

// The pinhole camera, without skew and with identity pose, that shows the largest part of what `lens` sees such that
// every pixel of it lies in the lens's image. A plain pinhole stays as it is. Focal lengths are the lens's, and pixels
// fall on the lens's own pixel grid at the optical axis, so that a lens that hardly distorts is hardly resampled. The
// view is limited to 63 degrees (tangent 2) from the axis to each side, beyond which a plane is no way to keep a
// picture. 0 x 0 px when there is no such rectangle.
Camera LargestPinhole(const Lens& lens);

}  // namespace meshwright
