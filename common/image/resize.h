#pragma once

#include "common/image/color_image.h"

namespace meshwright {

// Reduces an image to width x height px (each between 1 and the image's own). A pixel of the result is the mean over
// the area of the source that it covers, fractions of pixels included; exact integer arithmetic, rounded to nearest, so
// the same on every machine.
ColorImage ReduceByArea(const ColorImage& image, int width, int height);

}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
