// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "common/image/color_image.h"

namespace meshwright {

// Pixels of a photograph that are not to be used (a mask's): nothing is seeded at them, grown into them or compared
// with them, as beyond the border of the photograph.
class IgnoredPixels {
 public:
  // None.
  IgnoredPixels() = default;
  // Those where the mask, made for a photograph of its size, is not white in all channels.
  explicit IgnoredPixels(const ColorImage& mask);

  // Whether there are any.
  explicit operator bool() const { return !sums_.empty(); }
  bool At(int x, int y) const { return AnyIn(x, y, x, y); }
  // Whether any pixel from (x0, y0) to (x1, y1) is ignored, both included; what lies beyond the image does not count.
  bool AnyIn(int x0, int y0, int x1, int y1) const;
  // Of the image of half the size, an odd last row or column left out: those with one below them.
  IgnoredPixels Halved() const;
  int64_t count() const { return sums_.empty() ? 0 : sums_.back(); }
  int64_t bytes() const { return static_cast<int64_t>(sums_.size() * sizeof(uint32_t)); }

 private:
  uint32_t SumAt(int x, int y) const {
    return sums_[static_cast<size_t>(y) * static_cast<size_t>(width_ + 1) + static_cast<size_t>(x)];
  }

  int width_ = 0;
  int height_ = 0;
  std::vector<uint32_t> sums_;  // of ignored pixels above and left of (x, y); (width + 1) * (height + 1)
};

// A mask of a photograph as files have it, made one of black and white: black or, in a JPEG, dark pixels are not to be
// used, all others are. Of several channels the brightest counts.
ColorImage BlackAndWhite(ColorImage mask, int least_white);

}  // namespace meshwright
