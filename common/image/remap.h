// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <vector>

#include "common/image/color_image.h"

namespace meshwright {

// Where a pixel's value comes from, in pixel coordinates of the source (centre of the top-left pixel at (0.5, 0.5)).
struct SourcePosition {
  double x = 0;  // px
  double y = 0;  // px
};

// Fills `sources`, one entry for each pixel of the result's row `row`.
using SourceOfRow = std::function<void(int row, std::vector<SourcePosition>* sources)>;

// A width x height image whose pixels are taken from `image` where `source_of_row` says, by cubic convolution (Keys
// 1981, a = -1/2). Positions are rounded to 1/256 px and the rest is integer arithmetic, so that the result is the same
// on every machine. Beyond its border the image continues with its outermost pixels.
ColorImage Remap(const ColorImage& image, int width, int height, const SourceOfRow& source_of_row);

}  // namespace meshwright
