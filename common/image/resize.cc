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

ColorImage ReduceByArea(const ColorImage& image, int width, int height) {
  MW_CHECK(width >= 1 && height >= 1 && width <= image.width && height <= image.height);
  if (width == image.width && height == image.height) return image;

  const auto row_samples = 3 * static_cast<size_t>(width);
  const auto source_row_samples = 3 * static_cast<size_t>(image.width);
  const uint64_t total_weight = static_cast<uint64_t>(image.width) * static_cast<uint64_t>(image.height);
  ColorImage result{.width = width, .height = height, .rgb = {}};
  result.rgb.resize(row_samples * static_cast<size_t>(height));

  std::vector<uint64_t> narrowed(row_samples);  // one source row, reduced along x
  size_t narrowed_row = static_cast<size_t>(image.height);
  const auto narrow = [&](size_t row) {
    if (row == narrowed_row) return;  // neighbouring target rows share a source row
    narrowed_row = row;
    const uint8_t* source = image.rgb.data() + row * source_row_samples;
    for (int64_t j = 0; j < width; ++j) {
      uint64_t sum[3] = {0, 0, 0};
      ForEachCovered(image.width, width, j, [&](size_t i, int64_t weight) {
        for (size_t c = 0; c < 3; ++c) sum[c] += static_cast<uint64_t>(weight) * source[3 * i + c];
      });
      std::copy(sum, sum + 3, narrowed.begin() + 3 * j);
    }
  };

  std::vector<uint64_t> accumulated(row_samples);
  for (int64_t j = 0; j < height; ++j) {
    std::fill(accumulated.begin(), accumulated.end(), total_weight / 2);
    ForEachCovered(image.height, height, j, [&](size_t i, int64_t weight) {
      narrow(i);
      for (size_t k = 0; k < row_samples; ++k) accumulated[k] += static_cast<uint64_t>(weight) * narrowed[k];
    });
    uint8_t* out = result.rgb.data() + static_cast<size_t>(j) * row_samples;
    for (size_t k = 0; k < row_samples; ++k) out[k] = static_cast<uint8_t>(accumulated[k] / total_weight);
  }
  return result;
}

}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
