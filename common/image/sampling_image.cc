// SPDX-License-Identifier: Apache-2.0
#include "common/image/sampling_image.h"

#include <algorithm>
#include <utility>

#include "common/base/check.h"

namespace meshwright {
namespace {

constexpr int kSmallestSidePx = 16;

std::vector<uint32_t> PackQuads(const GreyImage& grey) {
  const auto width = static_cast<size_t>(grey.width);
  const auto height = static_cast<size_t>(grey.height);
  std::vector<uint32_t> quads(width * height);
  for (size_t y = 0; y < height; ++y) {
    const uint8_t* row = &grey.grey[y * width];
    const uint8_t* below = &grey.grey[std::min(y + 1, height - 1) * width];
    uint32_t* out = &quads[y * width];
    for (size_t x = 0; x < width; ++x) {
      const size_t right = std::min(x + 1, width - 1);
      out[x] = static_cast<uint32_t>(row[x]) | static_cast<uint32_t>(row[right]) << 8 |
               static_cast<uint32_t>(below[x]) << 16 | static_cast<uint32_t>(below[right]) << 24;
    }
  }
  return quads;
}

// Mean of 2 x 2 pixels; an odd last row or column is left out.
GreyImage Halve(const GreyImage& grey) {
  GreyImage half{grey.width / 2, grey.height / 2, {}};
  half.grey.resize(static_cast<size_t>(half.width) * static_cast<size_t>(half.height));
  for (int y = 0; y < half.height; ++y) {
    for (int x = 0; x < half.width; ++x) {
      const int sum =
          grey.At(2 * x, 2 * y) + grey.At(2 * x + 1, 2 * y) + grey.At(2 * x, 2 * y + 1) + grey.At(2 * x + 1, 2 * y + 1);
      half.grey[static_cast<size_t>(y) * static_cast<size_t>(half.width) + static_cast<size_t>(x)] =
          static_cast<uint8_t>((sum + 2) / 4);
    }
  }
  return half;
}

}  // namespace

SamplingImage::SamplingImage(const GreyImage& grey, int levels, IgnoredPixels ignored) : ignored_(std::move(ignored)) {
  MW_CHECK(levels >= 1);
  MW_CHECK(grey.width > 0 && grey.height > 0);
  levels_.push_back({grey.width, grey.height, PackQuads(grey)});
  GreyImage current = grey;
  while (level_count() < levels && std::min(current.width, current.height) >= 2 * kSmallestSidePx) {
    current = Halve(current);
    levels_.push_back({current.width, current.height, PackQuads(current)});
  }
}

int64_t SamplingImage::bytes() const {
  int64_t total = ignored_.bytes();
  for (const Level& level : levels_) total += static_cast<int64_t>(level.quads.size() * sizeof(uint32_t));
  return total;
}

}  // namespace meshwright
