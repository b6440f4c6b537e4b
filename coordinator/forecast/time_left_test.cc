// SPDX-License-Identifier: Apache-2.0
#include "coordinator/forecast/time_left.h"

#include <cstdint>

#include <gtest/gtest.h>

namespace meshwright {
namespace {

// A job that takes two seconds, and a microsecond for each ray that it grows.
JobTimes Job(double rays_grown) {
  return {.rays_grown = static_cast<int64_t>(rays_grown), .preparing_seconds = 2, .growing_seconds = 1e-6 * rays_grown};
}

TEST(JobRateTest, TheLawOfTheJobsIsFoundWhateverTheyGrew) {
  JobRate rate;
  EXPECT_FALSE(rate.is_known());
  CameraWork work;
  double seconds = 0;
  for (const double expected : {8e6, 4e6, 1e6, 5e5, 0.0}) {
    rate.Add(Job(0.5 * expected), expected);
    work.Add(expected);
    seconds += Job(0.5 * expected).seconds();
  }
  EXPECT_TRUE(rate.is_known());
  // Half of what was expected was grown, and will be.
  EXPECT_NEAR(rate.SecondsOf(work), seconds, 1e-9);
}

TEST(JobRateTest, LaterJobsCountMore) {
  JobRate rate;
  for (int i = 0; i < 50; ++i) rate.Add(Job(1e6), 1e6);
  for (int i = 0; i < 50; ++i) rate.Add(Job(1e5), 1e6);  // what is left is hard to grow
  CameraWork work;
  work.Add(1e6);
  EXPECT_NEAR(rate.SecondsOf(work), 2.1, 0.1);
}

TEST(TimesOfReportTest, WhatIsNoReportIsNothing) {
  const JobTimes times =
      TimesOfReport(R"({"rays_grown": 7, "seconds": {"loading": 1, "seeding": 2, "growing": 4, "refinement": 8}})");
  EXPECT_EQ(times.rays_grown, 7);
  EXPECT_EQ(times.preparing_seconds, 3);
  EXPECT_EQ(times.growing_seconds, 12);
  for (const char* const text : {"", "{", "[]", "{\"seconds\": 5}", "{\"seconds\": {\"growing\": \"1\"}}",
                                 "{\"rays_grown\": -3, \"seconds\": {\"growing\": -1, \"loading\": null}}"}) {
    EXPECT_EQ(TimesOfReport(text).seconds(), 0) << text;
    EXPECT_EQ(TimesOfReport(text).rays_grown, 0) << text;
  }
  EXPECT_LT(TimesOfReport(R"({"seconds": {"growing": 1e300}})").seconds(), 1e8);
}

// Jobs of equal length, some at the same time: after each of them what is said is about what it comes to.
TEST(CameraSecondsLeftTest, ItIsRightForAnyNumberOfJobsAtTheSameTime) {
  for (const int at_once : {1, 2, 8}) {
    JobRate rate;
    constexpr int kJobs = 64;
    const double one = Job(3e6).seconds();
    double done_seconds = 0;
    for (int done = 1; done < kJobs; ++done) {
      rate.Add(Job(3e6), 6e6);
      done_seconds += one;
      // Jobs end one after the other, evenly spread.
      const double elapsed = one + one / at_once * (done - 1);
      const double all = one + one / at_once * (kJobs - 1);
      if (done < 2 * at_once) continue;
      CameraWork left;
      for (int i = done; i < kJobs; ++i) left.Add(6e6);
      const double said = CameraSecondsLeft(rate, left, done_seconds, done, elapsed);
      EXPECT_NEAR(said, all - elapsed, 0.2 * (all - elapsed) + one) << at_once << " at once, " << done << " done";
    }
  }
}

TEST(CameraSecondsLeftTest, NothingIsSaidBeforeTheFirstIsDone) {
  JobRate rate;
  CameraWork left;
  EXPECT_EQ(CameraSecondsLeft(rate, left, 0, 0, 1), 0);  // there is nothing to do
  left.Add(1e6);
  EXPECT_EQ(CameraSecondsLeft(rate, left, 0, 0, 1), -1);
  rate.Add(Job(1e6), 1e6);  // before a process was started anew
  EXPECT_EQ(CameraSecondsLeft(rate, left, 0, 0, 1), -1);
  EXPECT_NEAR(CameraSecondsLeft(rate, left, 3, 1, 3), 3, 1e-9);
}

}  // namespace
}  // namespace meshwright
