// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "common/image/sampling_image.h"

namespace meshwright {

// The part of a photograph that shows a black backdrop: a cloth behind an object, a mask painted black. It has texture
// enough for photo-consistency (folds, dust, noise), and many cameras agree on it, but nobody wants it. A photograph
// has a backdrop when nearly all of its border is dark; the backdrop is then what is dark and connected with the
// border, with the specks in it. Shadows within the object are not.
class Backdrop {
 public:
  explicit Backdrop(const SamplingImage& image);

  bool empty() const { return covered_.empty(); }
  bool Covers(int x, int y) const {
    if (covered_.empty()) return false;
    const int column = x / 2 < columns_ ? x / 2 : columns_ - 1;
    const int row = y / 2 < rows_ ? y / 2 : rows_ - 1;
    return covered_[static_cast<size_t>(row) * static_cast<size_t>(columns_) + static_cast<size_t>(column)] != 0;
  }
  // Whether there is a backdrop and this grey level is as dark: it may be a piece of it that the object surrounds.
  bool MayBe(int grey) const { return !covered_.empty() && grey <= kDark; }

 private:
  // Folds of a cloth catch light: the backdrop goes on up to here, grey levels.
  static constexpr int kDark = 48;

  int columns_ = 0;  // of blocks of 2 x 2 px
  int rows_ = 0;
  std::vector<uint8_t> covered_;  // empty: no backdrop
};

}  // namespace meshwright
