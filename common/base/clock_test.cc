// SPDX-License-Identifier: Apache-2.0
#include "common/base/clock.h"

#include <gtest/gtest.h>

namespace meshwright {
namespace {

TEST(ClockTest, TheRealOneGoesOn) {
  const Clock& clock = SystemClock();
  const absl::Time now = clock.Now();
  const absl::Duration uptime = clock.Uptime();
  EXPECT_GT(now, absl::FromUnixSeconds(1'700'000'000));
  EXPECT_GE(clock.Uptime(), uptime);
  EXPECT_EQ(&SystemClock(), &clock);
}

TEST(StopwatchTest, MeasuresWhatPassedAndNotWhatWasSet) {
  ManualClock clock;
  Stopwatch stopwatch(clock);
  const absl::Time begin = clock.Now();
  clock.Advance(absl::Seconds(2));
  clock.SetForward(-absl::Hours(1));
  EXPECT_EQ(clock.Now(), begin + absl::Seconds(2) - absl::Hours(1));
  EXPECT_EQ(stopwatch.Elapsed(), absl::Seconds(2));
  EXPECT_EQ(stopwatch.Lap(), 2.0);
  clock.Advance(absl::Seconds(3));
  EXPECT_EQ(stopwatch.Seconds(), 3.0);
  EXPECT_EQ(stopwatch.Lap(), 3.0);
  EXPECT_EQ(stopwatch.Lap(), 0.0);
}

}  // namespace
}  // namespace meshwright
