// SPDX-License-Identifier: Apache-2.0
#include "worker/photo_consistency/backdrop.h"

#include <cstddef>
#include <utility>

namespace meshwright {
namespace {

// A border is dark when this share of it is no brighter than that, grey levels. The object may reach the border.
constexpr double kDarkShareOfBorder = 0.9;
constexpr int kDarkBorder = 32;
// Bright specks in the backdrop up to this share of the photograph belong to it.
constexpr double kSpeckShare = 5e-4;

// Mean of 2 x 2 pixels.
int BlockMean(const SamplingImage& image, int column, int row) {
  const uint32_t quad =
      image.level(0)
          .quads[static_cast<size_t>(2 * row) * static_cast<size_t>(image.width()) + static_cast<size_t>(2 * column)];
  return static_cast<int>(((quad & 0xFFU) + (quad >> 8 & 0xFFU) + (quad >> 16 & 0xFFU) + (quad >> 24)) / 4);
}

bool HasDarkBorder(const SamplingImage& image, int columns, int rows) {
  int64_t dark = 0;
  int64_t all = 0;
  const auto look_at = [&](int column, int row) {
    ++all;
    if (BlockMean(image, column, row) <= kDarkBorder) ++dark;
  };
  for (int column = 0; column < columns; ++column) {
    look_at(column, 0);
    look_at(column, rows - 1);
  }
  for (int row = 0; row < rows; ++row) {
    look_at(0, row);
    look_at(columns - 1, row);
  }
  return static_cast<double>(dark) >= kDarkShareOfBorder * static_cast<double>(all);
}

// Regions of a grid, by 4-connection.
class Regions {
 public:
  Regions(int columns, int rows) : columns_(columns), rows_(rows) {}

  // The blocks connected with `first` over blocks that `enters` lets in; it marks what it has seen.
  template <typename Enters>
  const std::vector<int32_t>& From(std::vector<int32_t> first, const Enters& enters) {
    region_ = std::move(first);
    for (size_t next = 0; next < region_.size(); ++next) {
      const int32_t block = region_[next];
      const int column = block % columns_;
      const int row = block / columns_;
      if (column > 0 && enters(block - 1)) region_.push_back(block - 1);
      if (column + 1 < columns_ && enters(block + 1)) region_.push_back(block + 1);
      if (row > 0 && enters(block - columns_)) region_.push_back(block - columns_);
      if (row + 1 < rows_ && enters(block + columns_)) region_.push_back(block + columns_);
    }
    return region_;
  }

 private:
  int columns_;
  int rows_;
  std::vector<int32_t> region_;
};

}  // namespace

Backdrop::Backdrop(const SamplingImage& image) : columns_(image.width() / 2), rows_(image.height() / 2) {
  if (columns_ < 2 || rows_ < 2 || !HasDarkBorder(image, columns_, rows_)) return;
  const int32_t blocks = columns_ * rows_;
  covered_.assign(static_cast<size_t>(blocks), 0);
  const auto enters_dark = [&](int32_t block) {
    uint8_t& covered = covered_[static_cast<size_t>(block)];
    if (covered != 0 || BlockMean(image, block % columns_, block / columns_) > kDark) return false;
    covered = 1;
    return true;
  };
  std::vector<int32_t> border;
  for (int32_t block = 0; block < blocks; ++block) {
    const int column = block % columns_;
    const int row = block / columns_;
    const bool at_border = column == 0 || row == 0 || column == columns_ - 1 || row == rows_ - 1;
    if (at_border && enters_dark(block)) border.push_back(block);
  }
  Regions regions(columns_, rows_);
  regions.From(std::move(border), enters_dark);

  std::vector<uint8_t> seen = covered_;
  const auto enters_rest = [&](int32_t block) {
    uint8_t& is_seen = seen[static_cast<size_t>(block)];
    if (is_seen != 0) return false;
    is_seen = 1;
    return true;
  };
  for (int32_t block = 0; block < blocks; ++block) {
    if (!enters_rest(block)) continue;
    const std::vector<int32_t>& region = regions.From({block}, enters_rest);
    if (static_cast<double>(region.size()) > kSpeckShare * blocks) continue;
    for (const int32_t speck : region) covered_[static_cast<size_t>(speck)] = 1;
  }
}

}  // namespace meshwright
