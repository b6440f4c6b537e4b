// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "common/image/color_image.h"
#include "common/image/ignored_pixels.h"

namespace meshwright {

// A grey image in the layout made for bilinear sampling: entry (x, y) holds the four pixels that surround it, packed
// into 32 bits (lowest byte first: (x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)), so that one load, or one lane of a
// gather, brings all that a sample needs. With a pyramid: level l is half the size of level l - 1.
class SamplingImage {
 public:
  struct Level {
    int width = 0;                // px
    int height = 0;               // px
    std::vector<uint32_t> quads;  // width * height
  };

  // `levels` >= 1; fewer are made when the image becomes smaller than 16 px. `ignored`: of level 0.
  SamplingImage(const GreyImage& grey, int levels, IgnoredPixels ignored = {});

  int width() const { return levels_[0].width; }
  int height() const { return levels_[0].height; }
  int level_count() const { return static_cast<int>(levels_.size()); }
  const Level& level(int i) const { return levels_[static_cast<size_t>(i)]; }
  // Grey value of a pixel of level 0.
  uint8_t At(int x, int y) const {
    return static_cast<uint8_t>(
        levels_[0].quads[static_cast<size_t>(y) * static_cast<size_t>(width()) + static_cast<size_t>(x)] & 0xFFU);
  }
  const IgnoredPixels& ignored() const { return ignored_; }
  int64_t bytes() const;

 private:
  std::vector<Level> levels_;
  IgnoredPixels ignored_;
};

}  // namespace meshwright
