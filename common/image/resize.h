// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "common/image/color_image.h"

namespace meshwright {

// Reduces an image to width x height px (each between 1 and the image's own). A pixel of the result is the mean over
// the area of the source that it covers, fractions of pixels included; exact integer arithmetic, rounded to nearest, so
// the same on every machine.
ColorImage ReduceByArea(const ColorImage& image, int width, int height);

// The same of an image whose rows come one after another, from the top: keeps a row or two of them.
class AreaReducer {
 public:
  AreaReducer(int source_width, int source_height, int width, int height);
  // 3 * source_width bytes; source_height times.
  void AddRow(const uint8_t* rgb);
  // After the last row.
  ColorImage Take() { return std::move(result_); }

 private:
  const int source_width_;
  const int source_height_;
  ColorImage result_;
  int64_t next_row_ = 0;               // of the source
  int64_t target_row_ = 0;             // that is being added up
  std::vector<uint64_t> narrowed_;     // the last source row, reduced along x
  std::vector<uint64_t> accumulated_;  // of the target row, in units of 1 / (source width * source height)
};

}  // namespace meshwright
