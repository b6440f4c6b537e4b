// SPDX-License-Identifier: Apache-2.0
#include "pipeline/cameras/nearest_descriptors.h"

#include <random>

#include <gtest/gtest.h>

namespace meshwright {
namespace {

std::vector<uint8_t> RandomDescriptors(size_t count, int most, uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<uint8_t> bytes(count * kDescriptorBytes);
  for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random() % static_cast<uint32_t>(most + 1));
  return bytes;
}

NearestDescriptors Expected(const std::vector<uint8_t>& a, const std::vector<uint8_t>& b) {
  NearestDescriptors nearest;
  for (size_t i = 0; i < a.size(); i += kDescriptorBytes) {
    int32_t index = -1;
    int32_t best = -1;
    int32_t second = 0;
    for (size_t j = 0; j < b.size(); j += kDescriptorBytes) {
      int32_t product = 0;
      for (size_t k = 0; k < kDescriptorBytes; ++k) product += a[i + k] * b[j + k];
      second = std::max(second, std::min(product, best));
      if (product > best) index = static_cast<int32_t>(j / kDescriptorBytes);
      best = std::max(best, product);
    }
    nearest.index.push_back(index);
    nearest.best.push_back(best);
    nearest.second.push_back(second);
  }
  return nearest;
}

void ExpectSame(const NearestDescriptors& found, const NearestDescriptors& expected) {
  EXPECT_EQ(found.index, expected.index);
  EXPECT_EQ(found.best, expected.best);
  EXPECT_EQ(found.second, expected.second);
}

// `most`: 255 reaches the largest products; 1 and 0 give many that are alike, of which the first is taken.
TEST(NearestDescriptors, AreThoseOfComparingOneByOne) {
  for (const int most : {0, 1, 255}) {
    for (const auto& [count_a, count_b] : {std::pair<size_t, size_t>{1, 1}, {3, 70}, {16, 33}, {37, 5}, {64, 64}}) {
      const std::vector<uint8_t> a = RandomDescriptors(count_a, most, 1);
      const std::vector<uint8_t> b = RandomDescriptors(count_b, most, 2);
      NearestDescriptors of_a;
      NearestDescriptors of_b;
      FindNearest(PackedDescriptors(a), PackedDescriptors(b), &of_a, &of_b);
      ExpectSame(of_a, Expected(a, b));
      ExpectSame(of_b, Expected(b, a));
    }
  }
}

TEST(NearestDescriptors, OfNothingThereIsNone) {
  const std::vector<uint8_t> some = RandomDescriptors(2, 255, 1);
  NearestDescriptors of_a;
  NearestDescriptors of_b;
  FindNearest(PackedDescriptors(some), PackedDescriptors(), &of_a, &of_b);
  EXPECT_EQ(of_a.index, std::vector<int32_t>({-1, -1}));
  EXPECT_TRUE(of_b.index.empty());
}

}  // namespace
}  // namespace meshwright
