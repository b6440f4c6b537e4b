// SPDX-License-Identifier: Apache-2.0
#include "common/image/ignored_pixels.h"

#include <gtest/gtest.h>

namespace meshwright {
namespace {

ColorImage White(int width, int height) {
  return {.width = width,
          .height = height,
          .rgb = std::vector<uint8_t>(3 * static_cast<size_t>(width) * static_cast<size_t>(height), 255)};
}

TEST(IgnoredPixelsTest, AMaskThatIsWhiteIgnoresNothing) {
  EXPECT_FALSE(IgnoredPixels());
  EXPECT_FALSE(IgnoredPixels(White(5, 4)));
  EXPECT_FALSE(IgnoredPixels(White(5, 4)).AnyIn(-10, -10, 10, 10));
}

TEST(IgnoredPixelsTest, EveryRectangleKnowsWhetherItHasOne) {
  ColorImage mask = White(7, 5);
  for (const auto& [x, y] : {std::pair{2, 1}, {6, 4}, {0, 3}}) mask.rgb[3 * static_cast<size_t>(7 * y + x) + 1] = 254;
  const IgnoredPixels ignored(mask);
  EXPECT_EQ(ignored.count(), 3);
  for (int y0 = -1; y0 <= 5; ++y0) {
    for (int y1 = y0; y1 <= 5; ++y1) {
      for (int x0 = -1; x0 <= 7; ++x0) {
        for (int x1 = x0; x1 <= 7; ++x1) {
          bool any = false;
          for (const auto& [x, y] : {std::pair{2, 1}, {6, 4}, {0, 3}}) {
            any = any || (x >= x0 && x <= x1 && y >= y0 && y <= y1);
          }
          EXPECT_EQ(ignored.AnyIn(x0, y0, x1, y1), any) << x0 << " " << y0 << " " << x1 << " " << y1;
        }
      }
    }
  }
}

TEST(IgnoredPixelsTest, TheBrightestChannelCounts) {
  ColorImage mask = White(3, 1);
  mask.rgb = {0, 0, 0, 0, 1, 0, 100, 127, 3};
  EXPECT_EQ(BlackAndWhite(mask, 1).rgb, (std::vector<uint8_t>{0, 0, 0, 255, 255, 255, 255, 255, 255}));
  EXPECT_EQ(BlackAndWhite(mask, 128).rgb, std::vector<uint8_t>(9, 0));
}

TEST(IgnoredPixelsTest, HalvedIgnoresWhatHasOneBelowIt) {
  ColorImage mask = White(7, 5);
  for (const auto& [x, y] : {std::pair{2, 1}, {6, 0}, {0, 3}}) mask.rgb[3 * static_cast<size_t>(7 * y + x)] = 0;
  const IgnoredPixels half = IgnoredPixels(mask).Halved();
  EXPECT_EQ(half.count(), 2) << "the odd last column is left out";
  EXPECT_TRUE(half.At(1, 0));
  EXPECT_TRUE(half.At(0, 1));
  EXPECT_FALSE(half.AnyIn(2, 0, 2, 1));
  EXPECT_FALSE(half.At(0, 0));
  EXPECT_FALSE(IgnoredPixels().Halved());
}

}  // namespace
}  // namespace meshwright
