// SPDX-License-Identifier: Apache-2.0
#include "pipeline/texturing/atlas_page.h"

#include <algorithm>
#include <cstddef>
#include <utility>

namespace meshwright {
namespace {

// One level of a pyramid: colours where there are any.
struct Level {
  ColorImage image;
  std::vector<uint8_t> covered;

  size_t Index(int x, int y) const {
    return static_cast<size_t>(y) * static_cast<size_t>(image.width) + static_cast<size_t>(x);
  }
};

// Each pixel the mean of the covered ones among the four below it.
Level Halve(const Level& level) {
  Level half;
  half.image.width = (level.image.width + 1) / 2;
  half.image.height = (level.image.height + 1) / 2;
  half.covered.assign(static_cast<size_t>(half.image.width) * static_cast<size_t>(half.image.height), 0);
  half.image.rgb.assign(3 * half.covered.size(), 0);
  for (int y = 0; y < half.image.height; ++y) {
    for (int x = 0; x < half.image.width; ++x) {
      int count = 0;
      std::array<int, 3> sum = {};
      for (int dy = 0; dy < 2; ++dy) {
        for (int dx = 0; dx < 2; ++dx) {
          if (2 * x + dx >= level.image.width || 2 * y + dy >= level.image.height) continue;
          const size_t i = level.Index(2 * x + dx, 2 * y + dy);
          if (level.covered[i] == 0) continue;
          ++count;
          for (size_t k = 0; k < 3; ++k) sum[k] += level.image.rgb[3 * i + k];
        }
      }
      if (count == 0) continue;
      const size_t i = half.Index(x, y);
      half.covered[i] = 1;
      for (size_t k = 0; k < 3; ++k) half.image.rgb[3 * i + k] = static_cast<uint8_t>((sum[k] + count / 2) / count);
    }
  }
  return half;
}

// Pixels beside covered ones take the mean of these, as often as `rounds` says.
void Dilate(Level& level, int rounds) {
  for (int round = 0; round < rounds; ++round) {
    const std::vector<uint8_t> before = level.covered;
    for (int y = 0; y < level.image.height; ++y) {
      for (int x = 0; x < level.image.width; ++x) {
        const size_t i = level.Index(x, y);
        if (before[i] != 0) continue;
        int count = 0;
        std::array<int, 3> sum = {};
        for (int v = std::max(0, y - 1); v <= std::min(level.image.height - 1, y + 1); ++v) {
          for (int u = std::max(0, x - 1); u <= std::min(level.image.width - 1, x + 1); ++u) {
            const size_t j = level.Index(u, v);
            if (before[j] == 0) continue;
            ++count;
            for (size_t k = 0; k < 3; ++k) sum[k] += level.image.rgb[3 * j + k];
          }
        }
        if (count == 0) continue;
        level.covered[i] = 1;
        for (size_t k = 0; k < 3; ++k) level.image.rgb[3 * i + k] = static_cast<uint8_t>((sum[k] + count / 2) / count);
      }
    }
  }
}

// Pixels without a colour take that of coarser levels.
void Fill(Level& level) {
  if (std::find(level.covered.begin(), level.covered.end(), 0) == level.covered.end()) return;
  if (level.image.width <= 1 && level.image.height <= 1) return;  // nothing has a colour
  Level half = Halve(level);
  Fill(half);
  for (int y = 0; y < level.image.height; ++y) {
    for (int x = 0; x < level.image.width; ++x) {
      const size_t i = level.Index(x, y);
      if (level.covered[i] != 0) continue;
      const size_t j = half.Index(x / 2, y / 2);
      for (size_t k = 0; k < 3; ++k) level.image.rgb[3 * i + k] = half.image.rgb[3 * j + k];
    }
  }
  std::fill(level.covered.begin(), level.covered.end(), 1);
}

}  // namespace

AtlasPage::AtlasPage(const PageSize& size) {
  covered_.assign(static_cast<size_t>(size.width) * static_cast<size_t>(size.height), 0);
  image_ = {size.width, size.height, std::vector<uint8_t>(3 * covered_.size(), 0)};
}

void AtlasPage::Draw(const PaintedChart& chart, int x, int y) {
  const auto width = static_cast<size_t>(chart.image.width);
  for (size_t row = 0; row < static_cast<size_t>(chart.image.height); ++row) {
    const size_t to = (static_cast<size_t>(y) + row) * static_cast<size_t>(image_.width) + static_cast<size_t>(x);
    std::copy_n(&chart.image.rgb[3 * row * width], 3 * width, &image_.rgb[3 * to]);
    std::copy_n(&chart.covered[row * width], width, &covered_[to]);
  }
}

ColorImage AtlasPage::Finish() {
  Level level = {std::move(image_), std::move(covered_)};
  Dilate(level, kChartPadding / 2);
  Fill(level);
  return std::move(level.image);
}

}  // namespace meshwright
