// SPDX-License-Identifier: Apache-2.0
#include "common/surface/surface_cache.h"

#include <atomic>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "common/surface/random_surface_testing.h"

namespace meshwright {
namespace {

absl::StatusOr<SparseSurface> Make(const std::string& digest) {
  return SparseSurface::From(RandomSurface(static_cast<uint32_t>(std::stoi(digest)), SmallCamera(40, 30), 1, 1, 0));
}

TEST(SurfaceCache, KeepsWhatFitsIntoTheBudgetTheLeastRecentlyUsedGoesFirst) {
  int loads = 0;
  SurfaceCache cache(
      [&](const std::string& digest) {
        ++loads;
        return Make(digest);
      },
      2 * Make("0")->bytes());
  const auto get = [&](const std::string& digest) {
    EXPECT_EQ((*cache.Get(digest))->camera_index, std::stoi(digest));
    return loads;
  };
  EXPECT_EQ(get("0"), 1);
  EXPECT_EQ(get("1"), 2);
  EXPECT_EQ(get("0"), 2);
  EXPECT_EQ(get("2"), 3);  // 1 goes
  EXPECT_EQ(get("0"), 3);
  EXPECT_EQ(get("1"), 4);
}

TEST(SurfaceCache, WhatIsLargerThanTheBudgetIsLentAndForgotten) {
  SurfaceCache cache(Make, Make("0")->bytes() - 1);
  const std::weak_ptr<const SparseSurface> gone = *cache.Get("3");
  EXPECT_TRUE(gone.expired());
}

TEST(SurfaceCache, ALoaderThatFailsIsAskedAgain) {
  bool broken = true;
  SurfaceCache cache(
      [&](const std::string& digest) -> absl::StatusOr<SparseSurface> {
        if (broken) return absl::NotFoundError("gone");
        return Make(digest);
      },
      1 << 20);
  EXPECT_TRUE(absl::IsNotFound(cache.Get("1").status()));
  broken = false;
  EXPECT_TRUE(cache.Get("1").ok());
}

TEST(SurfaceCache, ManyThreadsMayAsk) {
  SurfaceCache cache(Make, 3 * Make("0")->bytes());
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&, t] {
      for (int i = 0; i < 100; ++i) {
        const int wanted = (i * (t + 1)) % 7;
        EXPECT_EQ((*cache.Get(std::to_string(wanted)))->camera_index, wanted);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
}

}  // namespace
}  // namespace meshwright
