// SPDX-License-Identifier: Apache-2.0
#include "common/image/remap.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "common/base/check.h"

namespace meshwright {
namespace {

constexpr int kSteps = 256;      // positions within a pixel
constexpr int kWeightBits = 12;  // weights sum to 2^12
constexpr int kWeightSum = 1 << kWeightBits;

using Weights = std::array<int32_t, 4>;  // of the pixels at -1, 0, 1, 2

// Keys' cubic for a = -1/2, at t = k / kSteps, in integers: numerators over 2 * kSteps^3, then rounded; the weight of
// the nearest pixel takes up the rounding so that a flat image stays flat.
std::array<Weights, kSteps> MakeWeights() {
  std::array<Weights, kSteps> table{};
  constexpr int64_t kOne = kSteps;
  constexpr int64_t kDenominator = 2 * kOne * kOne * kOne;
  for (int64_t t = 0; t < kSteps; ++t) {
    const int64_t numerators[4] = {-t * t * t + 2 * kOne * t * t - kOne * kOne * t,
                                   3 * t * t * t - 5 * kOne * t * t + kDenominator,
                                   -3 * t * t * t + 4 * kOne * t * t + kOne * kOne * t, t * t * t - kOne * t * t};
    Weights& weights = table[static_cast<size_t>(t)];
    int32_t sum = 0;
    for (size_t i = 0; i < 4; ++i) {
      const int64_t scaled = numerators[i] * kWeightSum * 2 + kDenominator;
      weights[i] = static_cast<int32_t>(std::floor(static_cast<double>(scaled) / (2 * kDenominator)));
      sum += weights[i];
    }
    weights[t < kSteps / 2 ? 1 : 2] += kWeightSum - sum;
  }
  return table;
}

// The pixel to the upper left of a position, and the position's place within the cell in 1/kSteps.
struct Cell {
  int64_t pixel;
  size_t step;
};

Cell CellOf(double position) {
  const auto fixed = static_cast<int64_t>(std::floor((position - 0.5) * kSteps + 0.5));
  const int64_t step = ((fixed % kSteps) + kSteps) % kSteps;
  return {(fixed - step) / kSteps, static_cast<size_t>(step)};
}

}  // namespace

ColorImage Remap(const ColorImage& image, int width, int height, const SourceOfRow& source_of_row) {
  MW_CHECK(image.width >= 1 && image.height >= 1 && width >= 1 && height >= 1);
  static const std::array<Weights, kSteps> kWeights = MakeWeights();
  ColorImage result{.width = width, .height = height, .rgb = {}};
  result.rgb.resize(size_t{3} * static_cast<size_t>(width) * static_cast<size_t>(height));
  std::vector<SourcePosition> sources(static_cast<size_t>(width));
  uint8_t* out = result.rgb.data();
  for (int row = 0; row < height; ++row) {
    source_of_row(row, &sources);
    for (const SourcePosition& source : sources) {
      // Far outside, the outermost pixel is the answer anyway: clamping first keeps the integers small.
      const Cell x = CellOf(std::clamp(source.x, -4.0, image.width + 4.0));
      const Cell y = CellOf(std::clamp(source.y, -4.0, image.height + 4.0));
      int64_t sums[3] = {0, 0, 0};
      for (int64_t j = 0; j < 4; ++j) {
        const int64_t source_row = std::clamp<int64_t>(y.pixel + j - 1, 0, image.height - 1);
        const uint8_t* pixels = image.rgb.data() + 3 * source_row * image.width;
        int32_t row_sums[3] = {0, 0, 0};
        for (int64_t i = 0; i < 4; ++i) {
          const int32_t weight = kWeights[x.step][static_cast<size_t>(i)];
          const uint8_t* pixel = pixels + 3 * std::clamp<int64_t>(x.pixel + i - 1, 0, image.width - 1);
          for (size_t c = 0; c < 3; ++c) row_sums[c] += weight * pixel[c];
        }
        for (size_t c = 0; c < 3; ++c) sums[c] += int64_t{kWeights[y.step][static_cast<size_t>(j)]} * row_sums[c];
      }
      for (const int64_t sum : sums) {
        const int64_t rounded = (sum + (int64_t{1} << (2 * kWeightBits - 1))) >> (2 * kWeightBits);
        *out++ = static_cast<uint8_t>(std::clamp<int64_t>(rounded, 0, 255));
      }
    }
  }
  return result;
}

}  // namespace meshwright
