// SPDX-License-Identifier: Apache-2.0
#include "common/image/ignored_pixels.h"

#include <algorithm>

namespace meshwright {
namespace {

// How many pixels above and left of each (x, y) are ignored, (width + 1) * (height + 1).
template <typename IsIgnored>
std::vector<uint32_t> SumUp(int width, int height, const IsIgnored& is_ignored) {
  const auto row_size = static_cast<size_t>(width) + 1;
  std::vector<uint32_t> sums(row_size * (static_cast<size_t>(height) + 1), 0);
  for (int y = 0; y < height; ++y) {
    uint32_t in_row = 0;
    for (int x = 0; x < width; ++x) {
      if (is_ignored(x, y)) ++in_row;
      const size_t here = (static_cast<size_t>(y) + 1) * row_size + static_cast<size_t>(x) + 1;
      sums[here] = sums[here - row_size] + in_row;
    }
  }
  return sums;
}

}  // namespace

IgnoredPixels::IgnoredPixels(const ColorImage& mask) : width_(mask.width), height_(mask.height) {
  if (std::all_of(mask.rgb.begin(), mask.rgb.end(), [](uint8_t sample) { return sample == 255; })) return;
  sums_ = SumUp(width_, height_, [&](int x, int y) { return mask.At(x, y) != std::array<uint8_t, 3>{255, 255, 255}; });
}

IgnoredPixels IgnoredPixels::Halved() const {
  IgnoredPixels half;
  if (sums_.empty()) return half;
  half.width_ = width_ / 2;
  half.height_ = height_ / 2;
  half.sums_ =
      SumUp(half.width_, half.height_, [&](int x, int y) { return AnyIn(2 * x, 2 * y, 2 * x + 1, 2 * y + 1); });
  return half;
}

bool IgnoredPixels::AnyIn(int x0, int y0, int x1, int y1) const {
  if (sums_.empty()) return false;
  const int left = std::clamp(x0, 0, width_);
  const int right = std::clamp(x1 + 1, left, width_);
  const int top = std::clamp(y0, 0, height_);
  const int bottom = std::clamp(y1 + 1, top, height_);
  return SumAt(right, bottom) + SumAt(left, top) != SumAt(left, bottom) + SumAt(right, top);
}

ColorImage BlackAndWhite(ColorImage mask, int least_white) {
  for (size_t i = 0; i + 2 < mask.rgb.size(); i += 3) {
    const uint8_t brightest = std::max({mask.rgb[i], mask.rgb[i + 1], mask.rgb[i + 2]});
    std::fill_n(mask.rgb.begin() + static_cast<std::ptrdiff_t>(i), 3, brightest >= least_white ? 255 : 0);
  }
  return mask;
}

}  // namespace meshwright
