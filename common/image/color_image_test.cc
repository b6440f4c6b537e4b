// SPDX-License-Identifier: Apache-2.0
#include "common/image/color_image.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "common/image/remap.h"
#include "common/image/resize.h"

namespace meshwright {
namespace {

ColorImage RandomImage(int width, int height, unsigned seed) {
  std::mt19937 generator(seed);
  ColorImage image{.width = width, .height = height, .rgb = {}};
  image.rgb.resize(size_t{3} * static_cast<size_t>(width) * static_cast<size_t>(height));
  for (uint8_t& sample : image.rgb) sample = static_cast<uint8_t>(generator() & 0xFFU);
  return image;
}

TEST(ToGrey, KeepsGreysAndWeighsColours) {
  const ColorImage image{.width = 3, .height = 1, .rgb = {255, 255, 255, 255, 0, 0, 17, 17, 17}};
  EXPECT_EQ(ToGrey(image).grey, (std::vector<uint8_t>{255, 77, 17}));
}

// The slow twin: cut both images into the finest common grid.
ColorImage ReduceByCommonGrid(const ColorImage& image, int width, int height) {
  ColorImage result{.width = width, .height = height, .rgb = {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (size_t c = 0; c < 3; ++c) {
        int64_t sum = 0;
        for (int v = y * image.height; v < (y + 1) * image.height; ++v) {
          for (int u = x * image.width; u < (x + 1) * image.width; ++u) sum += image.At(u / width, v / height)[c];
        }
        const int64_t area = int64_t{image.width} * image.height;
        result.rgb.push_back(static_cast<uint8_t>((sum + area / 2) / area));
      }
    }
  }
  return result;
}

TEST(ReduceByArea, EqualsTheMeanOverACommonGrid) {
  const ColorImage image = RandomImage(13, 9, 1);
  for (const auto& [width, height] : {std::pair{13, 9}, {12, 9}, {13, 8}, {6, 4}, {5, 3}, {1, 1}, {7, 2}}) {
    EXPECT_EQ(ReduceByArea(image, width, height).rgb, ReduceByCommonGrid(image, width, height).rgb)
        << width << " x " << height;
  }
}

SourceOfRow Shifted(double dx, double dy) {
  return [=](int row, std::vector<SourcePosition>* sources) {
    for (size_t x = 0; x < sources->size(); ++x) {
      (*sources)[x] = {static_cast<double>(x) + 0.5 + dx, row + 0.5 + dy};
    }
  };
}

TEST(Remap, IdentityAndWholeShiftsCopyPixels) {
  const ColorImage image = RandomImage(20, 15, 2);
  EXPECT_EQ(Remap(image, 20, 15, Shifted(0, 0)).rgb, image.rgb);
  const ColorImage shifted = Remap(image, 10, 10, Shifted(3, 2));
  for (int y = 0; y < 10; ++y) {
    for (int x = 0; x < 10; ++x) EXPECT_EQ(shifted.At(x, y), image.At(x + 3, y + 2));
  }
}

TEST(Remap, ContinuesTheBorderOutwards) {
  const ColorImage image = RandomImage(4, 4, 3);
  EXPECT_EQ(Remap(image, 1, 1, Shifted(-100, -1e300)).At(0, 0), image.At(0, 0));
  EXPECT_EQ(Remap(image, 1, 1, Shifted(1e300, 100)).At(0, 0), image.At(3, 3));
}

TEST(Remap, ReproducesQuadraticsAndFlatImages) {
  // Cubic convolution is exact for polynomials up to the second degree, here up to rounding of pixels.
  const auto parabola = [](double x) { return 20 + 0.5 * x + 0.05 * x * x; };
  ColorImage image{.width = 60, .height = 8, .rgb = {}};
  ColorImage flat = image;
  for (int i = 0; i < 60 * 8; ++i) {
    const auto value = static_cast<uint8_t>(std::lround(parabola(i % 60 + 0.5)));
    image.rgb.insert(image.rgb.end(), {value, value, value});
    flat.rgb.insert(flat.rgb.end(), {201, 201, 201});
  }
  for (double shift = 0; shift < 1; shift += 0.037) {
    const ColorImage result = Remap(image, 50, 4, Shifted(4 + shift, 2 + shift));
    for (int x = 0; x < 50; ++x) EXPECT_NEAR(result.At(x, 1)[1], parabola(x + 4.5 + shift), 1.2);
    const ColorImage flat_result = Remap(flat, 50, 4, Shifted(4 + shift, 2 + shift));
    for (const uint8_t sample : flat_result.rgb) EXPECT_EQ(sample, 201);
  }
}

}  // namespace
}  // namespace meshwright
