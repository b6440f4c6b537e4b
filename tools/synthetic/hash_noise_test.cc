// SPDX-License-Identifier: Apache-2.0
#include "tools/synthetic/hash_noise.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

namespace meshwright {
namespace {

TEST(HashRandomTest, NormalNumbersHaveMeanZeroAndVarianceOne) {
  HashRandom random(3);
  constexpr int kCount = 100000;
  double sum = 0;
  double squares = 0;
  for (int i = 0; i < kCount; ++i) {
    const double x = random.Normal();
    sum += x;
    squares += x * x;
  }
  EXPECT_NEAR(sum / kCount, 0, 0.02);
  EXPECT_NEAR(squares / kCount, 1, 0.02);
}

TEST(HashRandomTest, EqualSeedsGiveEqualStreams) {
  HashRandom a(5);
  HashRandom b(5);
  HashRandom c(6);
  const double first = a.Uniform(2, 3);
  EXPECT_EQ(first, b.Uniform(2, 3));
  EXPECT_NE(first, c.Uniform(2, 3));
  EXPECT_GE(first, 2);
  EXPECT_LT(first, 3);
}

TEST(ValueNoiseTest, IsContinuousAndBounded) {
  float low = 1;
  float high = -1;
  float last = ValueNoise({-20, 0.3F, -0.7F}, 9);
  for (int i = 1; i < 4000; ++i) {
    const float value = ValueNoise({-20 + 0.01F * static_cast<float>(i), 0.3F, -0.7F}, 9);
    EXPECT_NEAR(value, last, 0.035);
    last = value;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  EXPECT_GE(low, -1);
  EXPECT_LE(high, 1);
  EXPECT_GT(high - low, 1);
}

TEST(FractalNoiseTest, NothingIsFinerThanTheFootprint) {
  // Over a tenth of a footprint the noise hardly changes, at any footprint.
  for (const float footprint : {0.01F, 0.1F}) {
    for (int i = 0; i < 200; ++i) {
      const Eigen::Vector3f x(0.37F * static_cast<float>(i), 1, 2);
      const Eigen::Vector3f nearby = x + Eigen::Vector3f(0.1F * footprint, 0, 0);
      const float here = FractalNoise(x, 1, 1, footprint, 4);
      EXPECT_NEAR(here, FractalNoise(nearby, 1, 1, footprint, 4), 0.6);
    }
  }
}

}  // namespace
}  // namespace meshwright
