// SPDX-License-Identifier: Apache-2.0
#include "worker/seeding/pixel_index.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace meshwright {
namespace {

constexpr int kWidth = 200;
constexpr int kHeight = 130;

std::vector<Eigen::Vector2f> RandomPoints(int count, std::mt19937& random) {
  std::vector<Eigen::Vector2f> points;
  points.reserve(static_cast<size_t>(count));
  for (int i = 0; i < count; ++i) {
    // A few lie just outside.
    points.emplace_back(static_cast<float>(random() % (kWidth + 6)) - 3, static_cast<float>(random() % kHeight) + 0.5F);
  }
  return points;
}

TEST(PixelIndexTest, FindsWhatLiesNearASegment) {
  std::mt19937 random(1);
  const std::vector<Eigen::Vector2f> points = RandomPoints(800, random);
  const PixelIndex index(kWidth, kHeight, 16, points);
  const auto random_place = [&] {
    return Eigen::Vector2d(static_cast<double>(random() % kWidth) + 0.3, static_cast<double>(random() % kHeight) + 0.7);
  };
  size_t total = 0;
  for (int round = 0; round < 300; ++round) {
    const Eigen::Vector2d from = random_place();
    Eigen::Vector2d to = round % 10 == 0 ? from : random_place();
    if (round % 7 == 0) to.x() = from.x();
    const double band = 0.5 + round % 4;
    std::vector<int32_t> found;
    index.FindNearSegment(from, to, band, found);
    std::vector<int32_t> expected;
    const double length = (to - from).norm();
    const Eigen::Vector2d unit = length > 0 ? Eigen::Vector2d((to - from) / length) : Eigen::Vector2d(1, 0);
    for (size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector2d offset = points[i].cast<double>() - from;
      const double along = offset.dot(unit);
      if (std::abs(offset.x() * unit.y() - offset.y() * unit.x()) <= band && along >= -band && along <= length + band) {
        expected.push_back(static_cast<int32_t>(i));
      }
    }
    total += expected.size();
    EXPECT_THAT(found, testing::UnorderedElementsAreArray(expected));
  }
  EXPECT_GT(total, 1000U);
}

TEST(PixelIndexTest, FindsTheNearest) {
  std::mt19937 random(2);
  const std::vector<Eigen::Vector2f> points = RandomPoints(150, random);
  const PixelIndex index(kWidth, kHeight, 16, points);
  for (int round = 0; round < 200; ++round) {
    const Eigen::Vector2f place(static_cast<float>(random() % kWidth), static_cast<float>(random() % kHeight));
    const float reach = 10.0F + static_cast<float>(round % 60);
    std::vector<std::pair<float, int32_t>> expected;
    for (size_t i = 0; i < points.size(); ++i) {
      const float squared = (points[i] - place).squaredNorm();
      if (squared <= reach * reach) expected.emplace_back(squared, static_cast<int32_t>(i));
    }
    std::sort(expected.begin(), expected.end());
    expected.resize(std::min<size_t>(expected.size(), 9));
    std::vector<int32_t> expected_indices;
    expected_indices.reserve(expected.size());
    for (const auto& [squared, i] : expected) expected_indices.push_back(i);
    EXPECT_EQ(index.FindNearest(place, 9, reach), expected_indices);
  }
  EXPECT_THAT(PixelIndex(10, 10, 4, {}).FindNearest({3, 3}, 5, 100), testing::IsEmpty());
}

}  // namespace
}  // namespace meshwright
