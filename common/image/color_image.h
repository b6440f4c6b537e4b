// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace meshwright {

// 8-bit RGB photograph, rows from the top, no padding.
struct ColorImage {
  int width = 0;
  int height = 0;
  std::vector<uint8_t> rgb;  // 3 * width * height

  std::array<uint8_t, 3> At(int column, int row) const {
    const size_t i = 3 * (static_cast<size_t>(row) * static_cast<size_t>(width) + static_cast<size_t>(column));
    return {rgb[i], rgb[i + 1], rgb[i + 2]};
  }
};

// 8-bit grey view, rows from the top, no padding. What photo-consistency compares.
struct GreyImage {
  int width = 0;
  int height = 0;
  std::vector<uint8_t> grey;  // width * height

  uint8_t At(int column, int row) const {
    return grey[static_cast<size_t>(row) * static_cast<size_t>(width) + static_cast<size_t>(column)];
  }
};

// Rec. 601 luma in integer arithmetic, the same on every machine: (77 R + 150 G + 29 B + 128) / 256.
GreyImage ToGrey(const ColorImage& image);

}  // namespace meshwright
