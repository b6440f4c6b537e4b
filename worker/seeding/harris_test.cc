// SPDX-License-Identifier: Apache-2.0
#include "worker/seeding/harris.h"

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <map>
#include <random>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace meshwright {
namespace {

GreyImage Noise(int width, int height, uint32_t seed, int levels) {
  GreyImage image{width, height, {}};
  std::mt19937 random(seed);
  for (int i = 0; i < width * height; ++i) {
    image.grey.push_back(static_cast<uint8_t>(random() % static_cast<uint32_t>(levels) * 255 / levels));
  }
  return image;
}

// Definition of the response, pixel by pixel.
float SlowResponse(const GreyImage& image, int x, int y, float k) {
  constexpr int kBinomial[5] = {1, 4, 6, 4, 1};
  constexpr int kSobel[3] = {1, 2, 1};
  float moments[3] = {0, 0, 0};
  float down[3][5];
  for (int i = -2; i <= 2; ++i) {
    float products[3][5];
    for (int j = -2; j <= 2; ++j) {
      int gx = 0;
      int gy = 0;
      for (int m = -1; m <= 1; ++m) {
        gx += kSobel[m + 1] * (image.At(x + i + 1, y + j + m) - image.At(x + i - 1, y + j + m));
        gy += kSobel[m + 1] * (image.At(x + i + m, y + j + 1) - image.At(x + i + m, y + j - 1));
      }
      products[0][j + 2] = static_cast<float>(gx * gx);
      products[1][j + 2] = static_cast<float>(gx * gy);
      products[2][j + 2] = static_cast<float>(gy * gy);
    }
    for (int c = 0; c < 3; ++c) {
      down[c][i + 2] = 0;
      for (int j = 0; j < 5; ++j) down[c][i + 2] += static_cast<float>(kBinomial[j]) * products[c][j];
    }
  }
  for (int c = 0; c < 3; ++c) {
    // The only additions whose order matters to the last bit.
    moments[c] = ((down[c][0] + down[c][4]) + 4.0F * (down[c][1] + down[c][3]) + 6.0F * down[c][2]) / (64.0F * 256.0F);
  }
  const float trace = moments[0] + moments[2];
  return (moments[0] * moments[2] - moments[1] * moments[1]) - k * (trace * trace);
}

std::vector<Corner> SlowCorners(const GreyImage& image, const HarrisOptions& options) {
  const auto response = [&](int x, int y) { return SlowResponse(image, x, y, options.k); };
  std::map<std::pair<int, int>, std::vector<Corner>> cells;
  for (int y = kHarrisMargin; y < image.height - kHarrisMargin; ++y) {
    for (int x = kHarrisMargin; x < image.width - kHarrisMargin; ++x) {
      const float here = response(x, y);
      bool is_corner = here >= options.min_response;
      for (int dy = -1; dy <= 1 && is_corner; ++dy) {
        for (int dx = -1; dx <= 1 && is_corner; ++dx) {
          if (dx == 0 && dy == 0) continue;
          const bool earlier = dy < 0 || (dy == 0 && dx < 0);
          const float there = response(x + dx, y + dy);
          is_corner = earlier ? there < here : there <= here;
        }
      }
      if (is_corner) cells[{y / options.cell_size, x / options.cell_size}].push_back({x, y, here});
    }
  }
  std::vector<Corner> corners;
  for (auto& [cell, found] : cells) {
    std::stable_sort(found.begin(), found.end(),
                     [](const Corner& a, const Corner& b) { return a.response > b.response; });
    found.resize(std::min(found.size(), static_cast<size_t>(options.corners_per_cell)));
    corners.insert(corners.end(), found.begin(), found.end());
  }
  return corners;
}

TEST(HarrisTest, EqualsSlowTwinWithAnyNumberOfThreads) {
  ThreadPool one(1);
  ThreadPool three(3);
  for (const auto& [width, height] : {std::pair{97, 61}, {64, 64}, {33, 70}, {9, 9}, {8, 30}, {40, 3}}) {
    for (const int levels : {2, 3, 256}) {  // few levels: plateaus and ties
      HarrisOptions options;
      options.cell_size = 16;
      options.corners_per_cell = 3;
      const GreyImage grey = Noise(width, height, static_cast<uint32_t>(width * levels), levels);
      const SamplingImage image(grey, 1);
      const std::vector<Corner> corners = DetectHarrisCorners(image, options, one);
      EXPECT_EQ(corners, SlowCorners(grey, options)) << width << " x " << height << ", " << levels << " levels";
      EXPECT_EQ(corners, DetectHarrisCorners(image, options, three));
    }
  }
}

TEST(HarrisTest, FindsTheCornersOfARectangleAndNoEdges) {
  GreyImage grey{100, 80, std::vector<uint8_t>(100 * 80, 40)};
  for (int y = 20; y < 60; ++y) {
    for (int x = 30; x < 70; ++x) grey.grey[static_cast<size_t>(y) * 100 + static_cast<size_t>(x)] = 200;
  }
  ThreadPool pool(1);
  const std::vector<Corner> corners = DetectHarrisCorners(SamplingImage(grey, 1), {}, pool);
  ASSERT_EQ(corners.size(), 4U);
  for (const auto& [x, y] : {std::pair{30, 20}, {69, 20}, {30, 59}, {69, 59}}) {
    EXPECT_TRUE(std::any_of(
        corners.begin(), corners.end(),
        [&, x = x, y = y](const Corner& corner) { return std::abs(corner.x - x) <= 1 && std::abs(corner.y - y) <= 1; }))
        << x << " " << y;
  }
}

TEST(HarrisTest, FlatImagesAndEdgesAndFaintNoiseHaveNone) {
  ThreadPool pool(1);
  GreyImage grey{64, 64, std::vector<uint8_t>(64 * 64, 128)};
  EXPECT_THAT(DetectHarrisCorners(SamplingImage(grey, 1), {}, pool), testing::IsEmpty());
  for (size_t i = 0; i < grey.grey.size(); ++i) grey.grey[i] = i % 64 < 31 ? 10 : 240;
  EXPECT_THAT(DetectHarrisCorners(SamplingImage(grey, 1), {}, pool), testing::IsEmpty());
  std::mt19937 random(1);
  for (uint8_t& value : grey.grey) value = static_cast<uint8_t>(127 + random() % 3);
  EXPECT_THAT(DetectHarrisCorners(SamplingImage(grey, 1), {}, pool), testing::IsEmpty());
}

}  // namespace
}  // namespace meshwright
