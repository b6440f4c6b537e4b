// SPDX-License-Identifier: Apache-2.0
#include "worker/photo_consistency/backdrop.h"

#include <cstdint>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace meshwright {
namespace {

constexpr int kWidth = 160;
constexpr int kHeight = 120;

void Fill(GreyImage& image, int left, int top, int right, int bottom, uint8_t grey) {
  for (int y = top; y < bottom; ++y) {
    for (int x = left; x < right; ++x) image.grey[static_cast<size_t>(y * kWidth + x)] = grey;
  }
}

// An object with a shadow in it before a cloth with a fold and a speck of dust; noise on all of it.
GreyImage ObjectBefore(uint8_t cloth) {
  GreyImage image{kWidth, kHeight, std::vector<uint8_t>(kWidth * kHeight, cloth)};
  Fill(image, 20, 0, 30, kHeight, static_cast<uint8_t>(cloth + 25));  // the fold
  Fill(image, 10, 10, 12, 12, 120);                                   // the speck
  Fill(image, 60, 30, 120, 90, 140);                                  // the object
  Fill(image, 80, 50, 100, 70, 10);                                   // its shadow
  std::mt19937 random(3);
  for (uint8_t& grey : image.grey) grey = static_cast<uint8_t>(grey + random() % 6);
  return image;
}

TEST(Backdrop, IsWhatIsDarkAndConnectedWithTheBorder) {
  const Backdrop backdrop(SamplingImage(ObjectBefore(4), 1));
  EXPECT_FALSE(backdrop.empty());
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const bool is_object = x >= 60 && x < 120 && y >= 30 && y < 90;
      EXPECT_EQ(backdrop.Covers(x, y), !is_object) << x << ' ' << y;
    }
  }
}

TEST(Backdrop, NeedsADarkBorder) {
  const Backdrop grey(SamplingImage(ObjectBefore(60), 1));
  EXPECT_TRUE(grey.empty());
  EXPECT_FALSE(grey.Covers(0, 0));
  GreyImage cut = ObjectBefore(4);
  Fill(cut, 0, 0, kWidth / 2, 3, 150);  // something bright along an eighth of it
  EXPECT_TRUE(Backdrop(SamplingImage(cut, 1)).empty());
}

TEST(Backdrop, OddSizesHaveNoUncoveredRim) {
  GreyImage black{33, 17, std::vector<uint8_t>(33 * 17, 0)};
  const Backdrop backdrop(SamplingImage(black, 1));
  EXPECT_TRUE(backdrop.Covers(32, 16));
}

}  // namespace
}  // namespace meshwright
