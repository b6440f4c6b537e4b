// SPDX-License-Identifier: Apache-2.0
#include "common/image/resize.h"

#include <algorithm>
#include <cstddef>

#include "common/base/check.h"

namespace meshwright {
namespace {

// Along one axis, in units of 1 / (source * target) of its length: source pixel i covers [i * target, (i + 1) *
// target), target pixel j covers [j * source, (j + 1) * source). Calls use(i, overlap) for the source pixels under j;
// the overlaps are integers that sum to `source`.
template <typename Use>
void ForEachCovered(int64_t source, int64_t target, int64_t j, const Use& use) {
  const int64_t begin = j * source;
  const int64_t end = begin + source;
  for (int64_t i = begin / target; i * target < end; ++i) {
    use(static_cast<size_t>(i), std::min(end, (i + 1) * target) - std::max(begin, i * target));
  }
}

}  // namespace

AreaReducer::AreaReducer(int source_width, int source_height, int width, int height)
    : source_width_(source_width), source_height_(source_height), result_{.width = width, .height = height, .rgb = {}} {
  MW_CHECK(width >= 1 && height >= 1 && width <= source_width && height <= source_height);
  const auto row_samples = 3 * static_cast<size_t>(width);
  result_.rgb.resize(row_samples * static_cast<size_t>(height));
  narrowed_.resize(row_samples);
  accumulated_.assign(row_samples, static_cast<uint64_t>(source_width) * static_cast<uint64_t>(source_height) / 2);
}

void AreaReducer::AddRow(const uint8_t* rgb) {
  MW_CHECK(next_row_ < source_height_);
  for (int64_t j = 0; j < result_.width; ++j) {
    uint64_t sum[3] = {0, 0, 0};
    ForEachCovered(source_width_, result_.width, j, [&](size_t i, int64_t weight) {
      for (size_t c = 0; c < 3; ++c) sum[c] += static_cast<uint64_t>(weight) * rgb[3 * i + c];
    });
    std::copy(sum, sum + 3, narrowed_.begin() + 3 * j);
  }
  // In the units of ForEachCovered; a source row is a part of one target row or two.
  const int64_t begin = next_row_ * result_.height;
  const int64_t end = begin + result_.height;
  ++next_row_;
  const uint64_t total_weight = static_cast<uint64_t>(source_width_) * static_cast<uint64_t>(source_height_);
  while (target_row_ < result_.height) {
    const int64_t target_begin = target_row_ * source_height_;
    const int64_t target_end = target_begin + source_height_;
    const auto weight = static_cast<uint64_t>(std::min(end, target_end) - std::max(begin, target_begin));
    for (size_t k = 0; k < accumulated_.size(); ++k) accumulated_[k] += weight * narrowed_[k];
    if (end < target_end) return;
    uint8_t* out = result_.rgb.data() + static_cast<size_t>(target_row_) * accumulated_.size();
    for (size_t k = 0; k < accumulated_.size(); ++k) {
      out[k] = static_cast<uint8_t>(accumulated_[k] / total_weight);
      accumulated_[k] = total_weight / 2;
    }
    ++target_row_;
    if (end == target_end) return;
  }
}

ColorImage ReduceByArea(const ColorImage& image, int width, int height) {
  if (width == image.width && height == image.height) return image;
  AreaReducer reducer(image.width, image.height, width, height);
  for (int row = 0; row < image.height; ++row) {
    reducer.AddRow(image.rgb.data() + 3 * static_cast<size_t>(row) * static_cast<size_t>(image.width));
  }
  return reducer.Take();
}

}  // namespace meshwright
