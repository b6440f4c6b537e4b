// SPDX-License-Identifier: Apache-2.0
#include "worker/job_input/view_cache.h"

#include <atomic>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

namespace meshwright {
namespace {

constexpr int kWidth = 96;
constexpr int kHeight = 72;

absl::StatusOr<View> MakeView(CameraIndex camera) {
  View view;
  view.camera = {.width = kWidth, .height = kHeight};
  view.color = {kWidth, kHeight, std::vector<uint8_t>(3 * kWidth * kHeight, static_cast<uint8_t>(camera))};
  return view;
}

TEST(ViewCacheTest, EstimateIsWhatAnImageTakes) {
  const View view = *MakeView(1);
  EXPECT_EQ(SamplingImage(ToGrey(view.color), kSamplingLevels).bytes(), SamplingImageBytes(kWidth, kHeight));
}

TEST(ViewCacheTest, KeepsWhatFitsIntoTheBudgetTheLeastRecentlyUsedGoesFirst) {
  ViewCache cache(MakeView, 2 * SamplingImageBytes(kWidth, kHeight));
  for (const CameraIndex camera : {0, 1, 0, 1}) EXPECT_EQ((*cache.Grey(camera))->At(3, 3), camera);
  EXPECT_EQ(cache.decoded_views(), 2);
  ASSERT_TRUE(cache.Grey(0).ok());
  ASSERT_TRUE(cache.Grey(2).ok());  // 1 goes
  EXPECT_EQ(cache.decoded_views(), 3);
  ASSERT_TRUE(cache.Grey(0).ok());
  EXPECT_EQ(cache.decoded_views(), 3);
  ASSERT_TRUE(cache.Grey(1).ok());
  EXPECT_EQ(cache.decoded_views(), 4);
}

TEST(ViewCacheTest, WhatAJobHoldsIsSharedEvenWithoutABudget) {
  ViewCache cache(MakeView, 0);
  const auto first = *cache.Grey(5);
  EXPECT_EQ(*cache.Grey(5), first);
  EXPECT_EQ(cache.GreyAndColor(5)->grey, first);
  EXPECT_EQ(cache.GreyAndColor(5)->color->At(0, 0)[1], 5);
  const std::weak_ptr<const SamplingImage> gone = *cache.Grey(6);
  EXPECT_TRUE(gone.expired());
}

TEST(ViewCacheTest, ThreadsThatWantTheSameViewDecodeItOnce) {
  std::atomic<int> loads{0};
  ViewCache cache(
      [&](CameraIndex camera) {
        ++loads;
        return MakeView(camera);
      },
      10 * SamplingImageBytes(kWidth, kHeight));
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&] {
      for (CameraIndex camera = 0; camera < 10; ++camera) EXPECT_EQ((*cache.Grey(camera))->At(0, 0), camera);
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(loads, 10);
}

TEST(ViewCacheTest, ALoaderThatFailsIsAskedAgain) {
  bool broken = true;
  ViewCache cache(
      [&](CameraIndex camera) -> absl::StatusOr<View> {
        if (broken) return absl::NotFoundError("gone");
        return MakeView(camera);
      },
      1 << 20);
  EXPECT_TRUE(absl::IsNotFound(cache.Grey(1).status()));
  EXPECT_TRUE(absl::IsNotFound(cache.GreyAndColor(1).status()));
  broken = false;
  EXPECT_TRUE(cache.Grey(1).ok());
}

}  // namespace
}  // namespace meshwright
