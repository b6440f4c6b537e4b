// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/lease_watch.h"

#include <gtest/gtest.h>

namespace meshwright {
namespace {

constexpr LeaseOptions kLease = {.lease = absl::Seconds(30), .job_time_limit = absl::Seconds(100)};

OpenJob Leased(absl::Time expires_at) {
  return {.reconstruction_id = "a", .sequence = 1, .epoch = 2, .lease_worker = "w", .lease_expires_at = expires_at};
}

TEST(LeaseWatchTest, ALeaseRunsOutWhenItStandsUnchangedForItsLength) {
  LeaseWatch watch(kLease);
  absl::Duration now = absl::ZeroDuration();
  const OpenJob job = Leased(absl::FromUnixSeconds(77));  // whatever the store's clock says
  EXPECT_FALSE(watch.HasRunOut(job));
  for (int seconds = 0; seconds < 30; seconds += 10) {
    watch.Observe({job}, now);
    EXPECT_FALSE(watch.HasRunOut(job)) << seconds;
    now += absl::Seconds(10);
  }
  watch.Observe({job}, now);
  EXPECT_TRUE(watch.HasRunOut(job));
  // Renewed, also to a time before: a clock was set back.
  const OpenJob renewed = Leased(absl::FromUnixSeconds(7));
  watch.Observe({renewed}, now);
  EXPECT_FALSE(watch.HasRunOut(renewed));
}

TEST(LeaseWatchTest, WhoWasNotLookedAtWasNotSilent) {
  LeaseWatch watch(kLease);
  absl::Duration now = absl::ZeroDuration();
  const OpenJob job = Leased(absl::UnixEpoch() + now);
  watch.Observe({job}, now);
  now += absl::Hours(3);
  watch.Observe({job}, now);
  EXPECT_FALSE(watch.HasRunOut(job));
  now += absl::Seconds(14);
  watch.Observe({job}, now);
  EXPECT_FALSE(watch.HasRunOut(job));
  now += absl::Seconds(1);
  watch.Observe({job}, now);
  EXPECT_TRUE(watch.HasRunOut(job));
}

TEST(LeaseWatchTest, AJobTakesTooLongHoweverOftenItsLeaseIsRenewed) {
  LeaseWatch watch(kLease);
  absl::Duration now = absl::ZeroDuration();
  for (int seconds = 0; seconds <= 100; seconds += 10) {
    const OpenJob job = Leased(absl::UnixEpoch() + now + absl::Seconds(30));
    watch.Observe({job}, now);
    EXPECT_FALSE(watch.HasRunOut(job));
    EXPECT_FALSE(watch.TakesTooLong(job, kLease.job_time_limit)) << seconds;
    now += absl::Seconds(10);
  }
  OpenJob job = Leased(absl::UnixEpoch() + now);
  watch.Observe({job}, now);
  EXPECT_TRUE(watch.TakesTooLong(job, kLease.job_time_limit));
  // Handed out again it begins anew.
  ++job.epoch;
  watch.Observe({job}, now);
  EXPECT_FALSE(watch.TakesTooLong(job, kLease.job_time_limit));
}

}  // namespace
}  // namespace meshwright
