// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/scheduling_pass.h"

#include <deque>

#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace meshwright {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using Kind = JobChange::Kind;

const absl::Time kNow = absl::FromUnixSeconds(1'000'000);
const LeaseOptions kLease = {.lease = absl::Seconds(30), .job_time_limit = absl::Seconds(100)};
const RetryOptions kRetry = {.max_failures = 3, .max_losses = 5, .backoff = absl::Seconds(1)};

OpenJob Waiting(const std::string& id, SequenceNumber sequence, int64_t memory_bytes = 10, double weight = 1) {
  return {.reconstruction_id = id,
          .weight = weight,
          .sequence = sequence,
          .epoch = 1,
          .memory_bytes = memory_bytes,
          .not_before = kNow};
}

OpenJob Leased(const std::string& id, SequenceNumber sequence, const std::string& worker,
               absl::Duration age = absl::ZeroDuration()) {
  OpenJob job = Waiting(id, sequence);
  job.epoch = 2;
  job.lease_worker = worker;
  job.lease_instance = "1";
  job.leased_at = kNow - age;
  job.lease_expires_at = kNow - age + kLease.lease;
  return job;
}

WorkerReport Worker(const std::string& id, int cores = 1, int64_t memory_bytes = 1000) {
  return {
      .worker = id, .instance = "1", .method_version = kMethodVersion, .cores = cores, .memory_bytes = memory_bytes};
}

HeldJob& Hold(WorkerReport& report, const OpenJob& job) { return report.held.emplace_back(HeldJob{KeyOf(job), {}}); }

// `watch`: it has observed the jobs.
SchedulingPass Plan(std::vector<OpenJob> jobs, absl::Time now = kNow, const LeaseWatch& watch = LeaseWatch(kLease)) {
  // Outlives the passes that look at it; a pass by itself has nothing to say of time.
  static std::deque<LeaseWatch> watches;
  watches.push_back(watch);
  return SchedulingPass(kLease, kRetry, watches.back(), std::move(jobs), now, [](const OpenJob&) {
    return std::vector<int64_t>{10, 5, 2};
  });
}

// Has seen the jobs unchanged for so long.
LeaseWatch Watched(const std::vector<OpenJob>& jobs, absl::Duration age) {
  LeaseWatch watch(kLease);
  absl::Duration now = absl::ZeroDuration();
  for (const absl::Duration end = now + age; now < end; now += absl::Seconds(1)) watch.Observe(jobs, now);
  watch.Observe(jobs, now);
  return watch;
}

// "kind reconstruction sequence" of each change.
std::vector<std::string> Changes(const SchedulingPass& plan) {
  std::vector<std::string> texts;
  for (const SchedulingPass::Change& one : plan.changes()) {
    const char* const names[] = {"claim", "renew", "complete", "skip", "release", "fail", "lose"};
    texts.push_back(absl::StrCat(names[static_cast<size_t>(one.change.kind)], " ", one.change.id, one.change.sequence));
  }
  return texts;
}

TEST(SchedulingPassTest, AWorkerGetsWhatFitsItsCoresAndMemory) {
  SchedulingPass plan = Plan({Waiting("a", 1, 600), Waiting("a", 2, 600), Waiting("a", 3, 300), Waiting("a", 4, 50)});
  plan.Grant(Worker("w", 3));
  EXPECT_THAT(Changes(plan), ElementsAre("claim a1", "claim a3", "claim a4"));
  plan.Grant(Worker("v", 3));
  EXPECT_THAT(Changes(plan), ElementsAre("claim a1", "claim a3", "claim a4", "claim a2"));
}

TEST(SchedulingPassTest, AWorkerGetsJobsOfItsMethodOnly) {
  OpenJob of_next = Waiting("a", 1);
  ++of_next.method_version;
  SchedulingPass plan = Plan({of_next, Waiting("b", 1)});
  plan.Grant(Worker("w", 3));
  EXPECT_THAT(Changes(plan), ElementsAre("claim b1"));
  WorkerReport silent = Worker("s", 3);
  silent.method_version = 0;  // it does not say
  plan.Grant(silent);
  EXPECT_THAT(Changes(plan), ElementsAre("claim b1"));
  WorkerReport next = Worker("n", 3);
  next.method_version = of_next.method_version;
  plan.Grant(next);
  EXPECT_THAT(Changes(plan), ElementsAre("claim b1", "claim a1"));
}

TEST(SchedulingPassTest, WhatItHoldsAlreadyCounts) {
  SchedulingPass plan = Plan({Leased("a", 1, "w"), Waiting("a", 2), Waiting("a", 3)});
  plan.Grant(Worker("w", 2));
  EXPECT_THAT(Changes(plan), ElementsAre("claim a2"));
  SchedulingPass full = Plan({Leased("a", 1, "w"), Waiting("a", 2, 995)});
  full.Grant(Worker("w", 2));
  EXPECT_THAT(Changes(full), IsEmpty());
}

TEST(SchedulingPassTest, CamerasAreEstimatedByWorkersThatCan) {
  const OpenJob job = Waiting("a", kCameraEstimation);
  SchedulingPass plan = Plan({job, Waiting("b", 1)});
  plan.Grant(Worker("w", 2));
  EXPECT_THAT(Changes(plan), ElementsAre("claim b1"));
  WorkerReport able = Worker("v", 2);
  able.has_colmap = true;
  plan.Grant(able);
  EXPECT_THAT(Changes(plan), ElementsAre("claim b1", absl::StrCat("claim a", kCameraEstimation)));
}

TEST(SchedulingPassTest, EstimatingCamerasMayTakeTwelveTimesAsLong) {
  const auto changes = [](absl::Duration age) {
    OpenJob job = Leased("a", kCameraEstimation, "w");
    LeaseWatch watch(kLease);
    for (absl::Duration uptime = absl::ZeroDuration(); uptime <= age; uptime += absl::Seconds(1)) {
      job.lease_expires_at += absl::Seconds(1);  // its worker is alive
      watch.Observe({job}, uptime);
    }
    SchedulingPass plan = Plan({job}, kNow, watch);
    plan.Expire();
    return Changes(plan);
  };
  EXPECT_THAT(changes(12 * kLease.job_time_limit - absl::Seconds(1)), IsEmpty());
  EXPECT_THAT(changes(12 * kLease.job_time_limit + absl::Seconds(1)),
              ElementsAre(absl::StrCat("fail a", kCameraEstimation)));
}

TEST(SchedulingPassTest, PhotographsThatGiveNoCamerasAreNotTriedAgain) {
  const OpenJob job = Leased("a", kCameraEstimation, "w");
  WorkerReport report = Worker("w");
  Hold(report, job).outcome = JobFailed{.reason = "no overlap", .permanent = true};
  SchedulingPass plan = Plan({job});
  plan.ApplyReport(report);
  EXPECT_THAT(Changes(plan), ElementsAre(absl::StrCat("skip a", kCameraEstimation)));
  EXPECT_EQ(plan.changes()[0].change.reason, "no overlap");
}

TEST(SchedulingPassTest, ADrainingWorkerGetsNothing) {
  SchedulingPass plan = Plan({Waiting("a", 1)});
  WorkerReport report = Worker("w");
  report.draining = true;
  plan.Grant(report);
  EXPECT_THAT(Changes(plan), IsEmpty());
}

TEST(SchedulingPassTest, ReconstructionsShareByWeightWhateverTheirSize) {
  std::vector<OpenJob> jobs;
  for (SequenceNumber sequence = 1; sequence <= 100; ++sequence) {
    jobs.push_back(Waiting("a", sequence));
    jobs.push_back(Waiting("c", sequence, 10, 2));
    if (sequence <= 15) jobs.push_back(Waiting("b", sequence));
  }
  SchedulingPass plan = Plan(jobs);
  for (int worker = 0; worker < 40; ++worker) plan.Grant(Worker(absl::StrCat("w", worker)));
  EXPECT_EQ(plan.LeasesIn("a"), 10);
  EXPECT_EQ(plan.LeasesIn("b"), 10);
  EXPECT_EQ(plan.LeasesIn("c"), 20);
}

TEST(SchedulingPassTest, LeasesThatOtherCoordinatorsGaveCountToo) {
  SchedulingPass plan =
      Plan({Leased("a", 1, "x"), Leased("a", 2, "y"), Waiting("a", 3), Waiting("b", 1), Waiting("b", 2)});
  plan.Grant(Worker("w", 2));
  EXPECT_THAT(Changes(plan), ElementsAre("claim b1", "claim b2"));
}

TEST(SchedulingPassTest, BackoffIsWaitedFor) {
  OpenJob job = Waiting("a", 1);
  job.not_before = kNow + absl::Seconds(5);
  SchedulingPass early = Plan({job}, kNow + absl::Seconds(4));
  early.Grant(Worker("w"));
  EXPECT_THAT(Changes(early), IsEmpty());
  SchedulingPass plan = Plan({job}, kNow + absl::Seconds(5));
  plan.Grant(Worker("w"));
  EXPECT_THAT(Changes(plan), ElementsAre("claim a1"));
  // Longer than any: the clock was set back.
  SchedulingPass back = Plan({job}, kNow - absl::Hours(1));
  back.Grant(Worker("w"));
  EXPECT_THAT(Changes(back), ElementsAre("claim a1"));
}

// Whatever the store's clock says now.
TEST(SchedulingPassTest, ASilentWorkerLosesItsLeasesAndAHeardOneKeepsThem) {
  const OpenJob silent = Leased("a", 1, "s", absl::Seconds(31));
  const OpenJob heard = Leased("a", 2, "h", absl::Seconds(31));
  WorkerReport report = Worker("h");
  Hold(report, heard);
  for (const absl::Duration jump : {absl::ZeroDuration(), absl::Hours(1), -absl::Hours(1)}) {
    SchedulingPass plan = Plan({silent, heard}, kNow + jump, Watched({silent, heard}, absl::Seconds(31)));
    EXPECT_FALSE(plan.ApplyReport(report));
    plan.Expire();
    EXPECT_THAT(Changes(plan), ElementsAre("renew a2", "lose a1")) << jump;
    EXPECT_EQ(plan.changes()[1].change.only_if_expired_at, silent.lease_expires_at);
    SchedulingPass early = Plan({silent}, kNow + jump, Watched({silent}, absl::Seconds(29)));
    early.Expire();
    EXPECT_THAT(Changes(early), IsEmpty()) << jump;
  }
}

TEST(SchedulingPassTest, AWorkerThatHangsAndIsAliveLosesTheJobToo) {
  OpenJob job = Leased("a", 1, "w");
  WorkerReport report = Worker("w");
  Hold(report, job);
  LeaseWatch watch(kLease);
  for (int seconds = 0; seconds <= 101; ++seconds) {
    job.lease_expires_at += absl::Seconds(1);
    watch.Observe({job}, absl::Seconds(seconds));
  }
  SchedulingPass plan = Plan({job}, kNow, watch);
  plan.ApplyReport(report);
  plan.Expire();
  ASSERT_THAT(Changes(plan), ElementsAre("fail a1"));
  EXPECT_THAT(plan.changes()[0].change.reason, HasSubstr("took longer"));
}

TEST(SchedulingPassTest, ANewProcessOfAWorkerHasLostWhatTheOldOneHeld) {
  WorkerReport report = Worker("w");
  report.instance = "2";
  SchedulingPass plan = Plan({Leased("a", 1, "w")});
  plan.ApplyReport(report);
  plan.Grant(report);
  EXPECT_THAT(Changes(plan), ElementsAre("lose a1"));
  EXPECT_THAT(plan.HeldBy("w", "2"), IsEmpty());
}

TEST(SchedulingPassTest, WhatRanOutOfMemoryIsMadeSmallerAndThenSkipped) {
  WorkerReport report = Worker("w");
  report.instance = "2";
  report.ran_out_of_memory = true;
  OpenJob job = Leased("a", 1, "w");
  for (int64_t attempt = 0; attempt < 2; ++attempt) {
    job.failed_attempts = attempt;
    job.reduction = attempt;
    SchedulingPass plan = Plan({job});
    plan.ApplyReport(report);
    ASSERT_THAT(Changes(plan), ElementsAre("fail a1"));
    EXPECT_TRUE(plan.changes()[0].change.out_of_memory);
    EXPECT_TRUE(plan.changes()[0].change.reduce);
    EXPECT_EQ(plan.changes()[0].change.memory_bytes, attempt == 0 ? 5 : 2);
  }
  job.failed_attempts = 2;
  job.reduction = 2;
  SchedulingPass plan = Plan({job});
  plan.ApplyReport(report);
  EXPECT_THAT(Changes(plan), ElementsAre("skip a1"));
}

TEST(SchedulingPassTest, FailuresBackOffAndEnd) {
  WorkerReport report = Worker("w");
  OpenJob job = Leased("a", 1, "w");
  Hold(report, job).outcome = JobFailed{.reason = "broken"};
  for (int64_t before = 0; before < 2; ++before) {
    job.failed_attempts = before;
    SchedulingPass plan = Plan({job});
    EXPECT_TRUE(plan.ApplyReport(report));
    ASSERT_THAT(Changes(plan), ElementsAre("fail a1"));
    EXPECT_EQ(plan.changes()[0].change.retry_at, kNow + absl::Seconds(1 << before));
    EXPECT_FALSE(plan.changes()[0].change.reduce);
  }
  job.failed_attempts = 2;
  SchedulingPass plan = Plan({job});
  plan.ApplyReport(report);
  ASSERT_THAT(Changes(plan), ElementsAre("skip a1"));
  EXPECT_EQ(plan.changes()[0].change.reason, "broken");
  // A camera that is committed already cannot be skipped.
  job.is_repair = true;
  SchedulingPass repair = Plan({job});
  repair.ApplyReport(report);
  EXPECT_THAT(Changes(repair), ElementsAre("fail a1"));
}

TEST(SchedulingPassTest, LosingWorkersCountsApartAndEndsToo) {
  WorkerReport report = Worker("w");
  OpenJob job = Leased("a", 1, "w");
  Hold(report, job).outcome = JobFailed{.infrastructure = true};
  job.losses = 3;
  SchedulingPass plan = Plan({job});
  plan.ApplyReport(report);
  ASSERT_THAT(Changes(plan), ElementsAre("lose a1"));
  EXPECT_EQ(plan.changes()[0].change.retry_at, kNow + absl::Seconds(4));
  job.losses = 4;
  SchedulingPass last = Plan({job});
  last.ApplyReport(report);
  EXPECT_THAT(Changes(last), ElementsAre("skip a1"));
}

TEST(SchedulingPassTest, ResultsAreTakenFromTheHolderOrFromWhoWasLateAndIsTheOnlyOne) {
  const auto changes_of = [](const OpenJob& job, int64_t epoch, const std::string& worker,
                             const std::string& instance = "1") {
    WorkerReport report = Worker(worker);
    report.instance = instance;
    HeldJob& held = Hold(report, job);
    held.key.epoch = epoch;
    held.outcome = JobFinished{.filtered_digest = std::string(64, 'a'), .report_json = "{}"};
    SchedulingPass plan = Plan({job});
    EXPECT_TRUE(plan.ApplyReport(report));
    return Changes(plan);
  };
  OpenJob job = Leased("a", 1, "w");
  EXPECT_THAT(changes_of(job, 2, "w"), ElementsAre("complete a1"));
  EXPECT_THAT(changes_of(job, 2, "other"), IsEmpty());
  EXPECT_THAT(changes_of(job, 1, "w"), IsEmpty());
  job.lease_worker.clear();
  EXPECT_THAT(changes_of(job, 2, "w"), ElementsAre("complete a1"));
  EXPECT_THAT(changes_of(job, 1, "w"), IsEmpty());
  // Another process was never given it, whatever it calls itself.
  EXPECT_THAT(changes_of(job, 2, "w", "2"), IsEmpty());
  EXPECT_THAT(changes_of(Waiting("a", 1), 1, "w"), IsEmpty());
}

TEST(SchedulingPassTest, AResultThatIsNoneIsAFailure) {
  const OpenJob job = Leased("a", 1, "w");
  for (const bool bad_digest : {true, false}) {
    WorkerReport report = Worker("w");
    Hold(report, job).outcome = JobFinished{.filtered_digest = bad_digest ? "../x" : std::string(64, 'a'),
                                            .report_json = bad_digest ? "{}" : "{"};
    SchedulingPass plan = Plan({job});
    plan.ApplyReport(report);
    EXPECT_THAT(Changes(plan), ElementsAre("fail a1"));
  }
}

TEST(SchedulingPassTest, ABlobThatCannotBeReadIsReportedAndNotTheJobsFault) {
  const OpenJob job = Leased("a", 1, "w");
  WorkerReport report = Worker("w");
  Hold(report, job).outcome = JobFailed{.damaged_blob = std::string(64, 'b')};
  SchedulingPass plan = Plan({job});
  plan.ApplyReport(report);
  EXPECT_THAT(Changes(plan), ElementsAre("lose a1"));
  EXPECT_THAT(plan.damaged_blobs(), ElementsAre(testing::Pair("a", std::string(64, 'b'))));
}

TEST(SchedulingPassTest, WhatIsGivenBackCountsForNothing) {
  const OpenJob job = Leased("a", 1, "w");
  WorkerReport report = Worker("w");
  Hold(report, job).outcome = JobReleased{};
  SchedulingPass plan = Plan({job});
  EXPECT_TRUE(plan.ApplyReport(report));
  EXPECT_THAT(Changes(plan), ElementsAre("release a1"));
}

}  // namespace
}  // namespace meshwright
