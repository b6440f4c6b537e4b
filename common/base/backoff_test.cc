// SPDX-License-Identifier: Apache-2.0
#include "common/base/backoff.h"

#include <limits>
#include <set>

#include <gtest/gtest.h>

namespace meshwright {
namespace {

constexpr BackoffOptions kOptions = {.first = absl::Milliseconds(200), .longest = absl::Seconds(5)};

TEST(BackoffTest, DoublesUpToTheLongest) {
  EXPECT_EQ(BackoffDelay(kOptions, 0), absl::ZeroDuration());
  EXPECT_EQ(BackoffDelay(kOptions, 1), absl::Milliseconds(200));
  EXPECT_EQ(BackoffDelay(kOptions, 2), absl::Milliseconds(400));
  EXPECT_EQ(BackoffDelay(kOptions, 5), absl::Milliseconds(3200));
  for (const int64_t failures : {int64_t{6}, int64_t{40}, int64_t{70}, std::numeric_limits<int64_t>::max()}) {
    EXPECT_EQ(BackoffDelay(kOptions, failures), absl::Seconds(5)) << failures;
  }
  const BackoffOptions none = {.first = absl::ZeroDuration(), .longest = absl::Seconds(5)};
  EXPECT_EQ(BackoffDelay(none, 7), absl::ZeroDuration());
}

TEST(BackoffTest, DelaysAreRandomWithinBoundsAndBeginAnewAfterASuccess) {
  std::set<absl::Duration> firsts;
  for (int round = 0; round < 20; ++round) {
    Backoff backoff(kOptions);
    for (int64_t failures = 1; failures < 9; ++failures) {
      const absl::Duration delay = backoff.Next();
      if (failures == 1) firsts.insert(delay);
      EXPECT_GE(delay, BackoffDelay(kOptions, failures) / 2);
      EXPECT_LE(delay, BackoffDelay(kOptions, failures));
    }
    backoff.Reset();
    EXPECT_LE(backoff.Next(), absl::Milliseconds(200));
  }
  EXPECT_GT(firsts.size(), 10U) << "callers that failed together come back together";
}

}  // namespace
}  // namespace meshwright
