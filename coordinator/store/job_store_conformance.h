#pragma once

#include <functional>
#include <memory>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "coordinator/store/job_store.h"

namespace meshwright {

// What every JobStore must do, run by every backend:
//   INSTANTIATE_TEST_SUITE_P(Sqlite, JobStoreConformance, testing::Values(factory));
// A factory makes a new, empty store that `reopen` can open again, as a restarted process would; or it says why there
// is none here.
struct JobStoreFixture {
  std::unique_ptr<JobStore> store;
  std::function<std::unique_ptr<JobStore>()> reopen;  // a second store over the same state
  std::string skip;
};
using JobStoreFactory = std::function<JobStoreFixture()>;

class JobStoreConformance : public testing::TestWithParam<JobStoreFactory> {
 protected:
  void SetUp() override {
    fixture_ = GetParam()();
    if (!fixture_.skip.empty()) GTEST_SKIP() << fixture_.skip;
    ASSERT_NE(fixture_.store, nullptr);
    ASSERT_TRUE(store().CreateReconstruction(kReconstruction, kNow).ok());
  }

  JobStore& store() { return *fixture_.store; }

  void Reopen() {
    fixture_.store.reset();
    fixture_.store = fixture_.reopen();
    ASSERT_NE(fixture_.store, nullptr);
  }

  static std::string Digest(char letter) { return std::string(64, letter); }

  // Cameras 1 .. count as jobs 1 .. count.
  void AssignJobs(const std::string& id, int count) {
    for (int s = 1; s <= count; ++s) ASSERT_TRUE(store().AssignCameraJob(id, s, s, 0, kNow).ok());
  }

  static LeaseRequest RequestOf(const std::string& worker, absl::Time now = kNow) {
    return {.worker = worker, .expires_at = now + kLease, .now = now};
  }

  // "reconstruction/sequence" of each.
  static std::vector<std::string> Names(const absl::StatusOr<std::vector<CameraLease>>& leases) {
    if (!leases.ok()) return {leases.status().ToString()};
    std::vector<std::string> names;
    for (const CameraLease& lease : *leases) {
      names.push_back(lease.reconstruction_id + "/" + std::to_string(lease.job.sequence));
    }
    return names;
  }

  static constexpr absl::Duration kLease = absl::Seconds(30);
  static inline const absl::Time kNow = absl::FromUnixSeconds(1'000'000'000);
  static inline const Reconstruction kReconstruction = {
      .id = "castle", .options_json = R"({"window":3})", .scene_digest = std::string(64, '0')};

  JobStoreFixture fixture_;
};

TEST_P(JobStoreConformance, ReconstructionsSurviveReopening) {
  Reopen();
  const auto stored = store().GetReconstruction("castle");
  ASSERT_TRUE(stored.ok()) << stored.status();
  EXPECT_EQ(stored->options_json, kReconstruction.options_json);
  EXPECT_EQ(stored->scene_digest, kReconstruction.scene_digest);
  EXPECT_EQ(stored->state, ReconstructionState::kRunning);

  ASSERT_TRUE(store().SetReconstructionState("castle", ReconstructionState::kDone).ok());
  Reopen();
  EXPECT_EQ(store().GetReconstruction("castle")->state, ReconstructionState::kDone);
}

TEST_P(JobStoreConformance, ReconstructionsAreListedById) {
  ASSERT_TRUE(store().CreateReconstruction({"abbey", "{}", Digest('1')}, kNow).ok());
  const auto all = store().ListReconstructions();
  ASSERT_TRUE(all.ok());
  ASSERT_EQ(all->size(), 2);
  EXPECT_EQ(all->at(0).id, "abbey");
  EXPECT_EQ(all->at(1).id, "castle");
}

TEST_P(JobStoreConformance, ReconstructionIdsAreUnique) {
  EXPECT_TRUE(absl::IsAlreadyExists(store().CreateReconstruction(kReconstruction, kNow)));
}

TEST_P(JobStoreConformance, UnknownReconstructionsAreNotFound) {
  EXPECT_TRUE(absl::IsNotFound(store().GetReconstruction("ruin").status()));
  EXPECT_TRUE(absl::IsNotFound(store().SetReconstructionState("ruin", ReconstructionState::kDone)));
  EXPECT_FALSE(store().AssignCameraJob("ruin", 1, 0, 0, kNow).ok());
  EXPECT_TRUE(absl::IsNotFound(store().CompleteCameraJob("ruin", 1, 1, Digest('a'), {}, "{}", kNow)));
}

TEST_P(JobStoreConformance, ValuesThatBreakAnInvariantAreRefused) {
  EXPECT_FALSE(store().CreateReconstruction({"", "{}", Digest('1')}, kNow).ok());
  EXPECT_FALSE(store().CreateReconstruction({"x", "not json", Digest('1')}, kNow).ok());
  EXPECT_FALSE(store().CreateReconstruction({"x", "{}", "short"}, kNow).ok());
  EXPECT_FALSE(store().AssignCameraJob("castle", 0, 1, 0, kNow).ok());   // sequences begin at 1
  EXPECT_FALSE(store().AssignCameraJob("castle", 1, -1, 0, kNow).ok());  // no such camera
  EXPECT_FALSE(store().AssignCameraJob("castle", 2, 1, 2, kNow).ok());   // sees itself
  ASSERT_TRUE(store().AssignCameraJob("castle", 1, 4, 0, kNow).ok());
  EXPECT_FALSE(store().CompleteCameraJob("castle", 1, 1, "short", {}, "{}", kNow).ok());
  EXPECT_FALSE(store().CompleteCameraJob("castle", 1, 1, Digest('a'), {}, "not json", kNow).ok());
  ASSERT_TRUE(store().CompleteCameraJob("castle", 1, 1, Digest('a'), {}, "{}", kNow).ok());
  EXPECT_FALSE(store().AddCommit("castle", {1, 4, Digest('b'), 5, 6}, kNow).ok());  // more accepted than filtered
  EXPECT_FALSE(store().AddCommit("castle", {1, 4, "", 5, 5}, kNow).ok());           // accepted, but where?
  EXPECT_FALSE(store().AddCommit("castle", {1, 9, Digest('b'), 5, 5}, kNow).ok());  // another camera
  EXPECT_TRUE(store().ListCommits("castle")->empty());
}

TEST_P(JobStoreConformance, AssignmentsAreIdempotentAndContradictionsRefused) {
  ASSERT_TRUE(store().AssignCameraJob("castle", 1, 7, 0, kNow).ok());
  EXPECT_TRUE(store().AssignCameraJob("castle", 1, 7, 0, kNow).ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(store().AssignCameraJob("castle", 1, 8, 0, kNow)));
  EXPECT_TRUE(absl::IsFailedPrecondition(store().AssignCameraJob("castle", 2, 7, 0, kNow)));  // one job a camera
  const auto jobs = store().ListCameraJobs("castle");
  ASSERT_EQ(jobs->size(), 1);
  EXPECT_EQ(jobs->at(0).camera, 7);
  EXPECT_EQ(jobs->at(0).epoch, 1);
  EXPECT_EQ(jobs->at(0).state, CameraJobState::kAssigned);
}

TEST_P(JobStoreConformance, ResultsSurviveReopening) {
  ASSERT_TRUE(store().AssignCameraJob("castle", 1, 7, 0, kNow).ok());
  ASSERT_TRUE(store().AssignCameraJob("castle", 2, 3, 0, kNow).ok());
  ASSERT_TRUE(store().CompleteCameraJob("castle", 2, 1, Digest('a'), {4, 11}, R"({"seeds":9})", kNow).ok());
  ASSERT_TRUE(store().SetCameraJobAside("castle", 1, 1, "picture is gone", kNow).ok());
  Reopen();
  const auto jobs = store().ListCameraJobs("castle");
  ASSERT_TRUE(jobs.ok());
  ASSERT_EQ(jobs->size(), 2);
  EXPECT_EQ(jobs->at(0).state, CameraJobState::kSetAside);
  EXPECT_EQ(jobs->at(0).set_aside_reason, "picture is gone");
  EXPECT_EQ(jobs->at(1).state, CameraJobState::kDone);
  EXPECT_EQ(jobs->at(1).filtered_digest, Digest('a'));
  EXPECT_THAT(jobs->at(1).weak_targets, testing::ElementsAre(4, 11));
  EXPECT_EQ(jobs->at(1).report_json, R"({"seeds":9})");
}

TEST_P(JobStoreConformance, AnOldEpochMayNotWrite) {
  ASSERT_TRUE(store().AssignCameraJob("castle", 1, 7, 0, kNow).ok());
  const auto epoch = store().ReassignCameraJob("castle", 1, kNow);
  ASSERT_TRUE(epoch.ok()) << epoch.status();
  EXPECT_EQ(*epoch, 2);
  EXPECT_TRUE(absl::IsAborted(store().CompleteCameraJob("castle", 1, 1, Digest('a'), {}, "{}", kNow)));
  EXPECT_TRUE(absl::IsAborted(store().SetCameraJobAside("castle", 1, 1, "slow", kNow)));
  EXPECT_EQ(store().ListCameraJobs("castle")->at(0).state, CameraJobState::kAssigned);
  EXPECT_TRUE(store().CompleteCameraJob("castle", 1, 2, Digest('b'), {}, "{}", kNow).ok());
  // Finished jobs are not handed out any more, and who comes late learns that it may drop its work.
  EXPECT_TRUE(absl::IsFailedPrecondition(store().ReassignCameraJob("castle", 1, kNow).status()));
  EXPECT_TRUE(absl::IsAborted(store().CompleteCameraJob("castle", 1, 1, Digest('a'), {}, "{}", kNow)));
  EXPECT_EQ(store().ListCameraJobs("castle")->at(0).filtered_digest, Digest('b'));
}

TEST_P(JobStoreConformance, RepeatedResultsAreHarmless) {
  ASSERT_TRUE(store().AssignCameraJob("castle", 1, 7, 0, kNow).ok());
  ASSERT_TRUE(store().CompleteCameraJob("castle", 1, 1, Digest('a'), {}, "{}", kNow).ok());
  EXPECT_TRUE(store().CompleteCameraJob("castle", 1, 1, Digest('a'), {}, "{}", kNow).ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(store().CompleteCameraJob("castle", 1, 1, Digest('b'), {}, "{}", kNow)));
  EXPECT_TRUE(absl::IsFailedPrecondition(store().SetCameraJobAside("castle", 1, 1, "slow", kNow)));
}

TEST_P(JobStoreConformance, CommitsComeInOrderOnceAndOfFinishedJobs) {
  ASSERT_TRUE(store().AssignCameraJob("castle", 1, 7, 0, kNow).ok());
  ASSERT_TRUE(store().AssignCameraJob("castle", 2, 3, 0, kNow).ok());
  ASSERT_TRUE(store().CompleteCameraJob("castle", 2, 1, Digest('a'), {}, "{}", kNow).ok());
  const Commit first = {1, 7, "", 0, 0};
  const Commit second = {2, 3, Digest('b'), 9, 4};
  EXPECT_TRUE(absl::IsFailedPrecondition(store().AddCommit("castle", second, kNow)));  // 1 is missing
  EXPECT_TRUE(absl::IsFailedPrecondition(store().AddCommit("castle", first, kNow)));   // not finished
  ASSERT_TRUE(store().SetCameraJobAside("castle", 1, 1, "gone", kNow).ok());
  EXPECT_TRUE(store().AddCommit("castle", first, kNow).ok());
  EXPECT_TRUE(store().AddCommit("castle", second, kNow).ok());
  EXPECT_TRUE(store().AddCommit("castle", second, kNow).ok());  // again: harmless
  EXPECT_TRUE(absl::IsFailedPrecondition(store().AddCommit("castle", {2, 3, Digest('c'), 9, 4}, kNow)));
  Reopen();
  const auto commits = store().ListCommits("castle");
  ASSERT_TRUE(commits.ok());
  EXPECT_THAT(*commits, testing::ElementsAre(first, second));
}

TEST_P(JobStoreConformance, ReconstructionsDoNotSeeEachOther) {
  ASSERT_TRUE(store().CreateReconstruction({"abbey", "{}", Digest('1')}, kNow).ok());
  ASSERT_TRUE(store().AssignCameraJob("abbey", 1, 2, 0, kNow).ok());
  ASSERT_TRUE(store().AssignCameraJob("castle", 1, 7, 0, kNow).ok());
  EXPECT_EQ(store().ListCameraJobs("abbey")->at(0).camera, 2);
  EXPECT_EQ(store().ListCameraJobs("castle")->at(0).camera, 7);
}

TEST_P(JobStoreConformance, ManyThreadsGetOneWinnerEach) {
  constexpr int kJobs = 8;
  constexpr int kThreads = 4;
  for (int s = 1; s <= kJobs; ++s) ASSERT_TRUE(store().AssignCameraJob("castle", s, s, 0, kNow).ok());
  std::vector<int> won(kThreads, 0);
  std::vector<std::thread> threads;
  threads.reserve(kThreads);
  for (int t = 0; t < kThreads; ++t) {
    threads.emplace_back([&, t] {
      for (int s = 1; s <= kJobs; ++s) {
        const std::string digest = Digest(static_cast<char>('a' + t));
        if (store().CompleteCameraJob("castle", s, 1, digest, {}, "{}", kNow).ok()) ++won[static_cast<size_t>(t)];
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(won[0] + won[1] + won[2] + won[3], kJobs);
}

// Leases.

TEST_P(JobStoreConformance, TheStoreHasAClock) {
  const auto first = store().Now();
  const auto second = store().Now();
  ASSERT_TRUE(first.ok() && second.ok()) << first.status();
  EXPECT_GT(*first, absl::FromUnixSeconds(900'000'000));
  EXPECT_LE(*first, *second);
}

TEST_P(JobStoreConformance, AJobIsLeasedToOneWorkerInANewEpoch) {
  AssignJobs("castle", 2);
  const auto leases = store().LeaseCameraJobs(RequestOf("ant"));
  ASSERT_TRUE(leases.ok()) << leases.status();
  ASSERT_EQ(leases->size(), 1);
  EXPECT_EQ(leases->at(0).reconstruction_id, "castle");
  EXPECT_EQ(leases->at(0).job.sequence, 1);
  EXPECT_EQ(leases->at(0).job.camera, 1);
  EXPECT_EQ(leases->at(0).job.epoch, 2);
  EXPECT_EQ(leases->at(0).job.lease_worker, "ant");
  EXPECT_EQ(leases->at(0).job.lease_expires_at, kNow + kLease);
  EXPECT_EQ(store().LeaseCameraJobs(RequestOf("bee"))->at(0).job.sequence, 2);
  EXPECT_TRUE(store().LeaseCameraJobs(RequestOf("cat"))->empty());
  Reopen();
  EXPECT_TRUE(store().LeaseCameraJobs(RequestOf("cat"))->empty());
  EXPECT_TRUE(absl::IsAborted(store().CompleteCameraJob("castle", 1, 1, Digest('a'), {}, "{}", kNow)));
  ASSERT_TRUE(store().CompleteCameraJob("castle", 1, 2, Digest('a'), {}, "{}", kNow).ok());
  EXPECT_EQ(store().GetCameraJob("castle", 1)->lease_worker, "");
  ASSERT_TRUE(store().SetCameraJobAside("castle", 2, 2, "gone", kNow).ok());
  EXPECT_TRUE(store().ListLeases("")->empty());
}

TEST_P(JobStoreConformance, LeasesNeedAWorkerAndTime) {
  AssignJobs("castle", 1);
  EXPECT_TRUE(absl::IsInvalidArgument(store().LeaseCameraJobs(RequestOf("")).status()));
  EXPECT_TRUE(
      absl::IsInvalidArgument(store().LeaseCameraJobs({.worker = "ant", .expires_at = kNow, .now = kNow}).status()));
}

TEST_P(JobStoreConformance, ReconstructionsTakeTurnsAsTheRequestSays) {
  for (const char* id : {"abbey", "barn"}) {
    ASSERT_TRUE(store().CreateReconstruction({id, "{}", Digest('1')}, kNow).ok());
    AssignJobs(id, 2);
  }
  AssignJobs("castle", 2);
  LeaseRequest request = RequestOf("ant");
  request.reconstruction_ids = {"castle", "ruin", "abbey", "castle"};
  request.max_jobs = 3;
  EXPECT_THAT(Names(store().LeaseCameraJobs(request)), testing::ElementsAre("castle/1", "castle/2", "abbey/1"));
  EXPECT_THAT(Names(store().LeaseCameraJobs(request)), testing::ElementsAre("abbey/2"));
  request.reconstruction_ids.clear();
  EXPECT_THAT(Names(store().LeaseCameraJobs(request)), testing::ElementsAre("barn/1", "barn/2"));
}

TEST_P(JobStoreConformance, WithoutTurnsTheLowestSequenceNumbersComeFirst) {
  ASSERT_TRUE(store().CreateReconstruction({"abbey", "{}", Digest('1')}, kNow).ok());
  AssignJobs("castle", 2);
  AssignJobs("abbey", 2);
  LeaseRequest request = RequestOf("ant");
  request.max_jobs = 10;
  EXPECT_THAT(Names(store().LeaseCameraJobs(request)),
              testing::ElementsAre("abbey/1", "castle/1", "abbey/2", "castle/2"));
}

TEST_P(JobStoreConformance, OnlyJobsThatFitAreLeased) {
  ASSERT_TRUE(store().AssignCameraJob("castle", 1, 1, 0, kNow, 0, 5'000'000'000).ok());
  ASSERT_TRUE(store().AssignCameraJob("castle", 2, 2, 0, kNow, 0, 3'000'000'000).ok());
  LeaseRequest request = RequestOf("small");
  request.memory_bytes = 4'000'000'000;
  request.max_jobs = 2;
  EXPECT_THAT(Names(store().LeaseCameraJobs(request)), testing::ElementsAre("castle/2"));
  request.memory_bytes = 5'000'000'000;
  EXPECT_THAT(Names(store().LeaseCameraJobs(request)), testing::ElementsAre("castle/1"));
  EXPECT_EQ(store().GetCameraJob("castle", 1)->memory_bytes, 5'000'000'000);
}

TEST_P(JobStoreConformance, OnlyRunningReconstructionsHandOutJobs) {
  AssignJobs("castle", 1);
  ASSERT_TRUE(store().SetReconstructionState("castle", ReconstructionState::kCancelled, "by its owner").ok());
  EXPECT_TRUE(store().LeaseCameraJobs(RequestOf("ant"))->empty());
}

TEST_P(JobStoreConformance, OnlyTheHolderRenews) {
  AssignJobs("castle", 1);
  ASSERT_TRUE(store().LeaseCameraJobs(RequestOf("ant")).ok());
  EXPECT_TRUE(store().RenewLease("castle", 1, 2, "ant", kNow + 2 * kLease, kNow).ok());
  EXPECT_EQ(store().GetCameraJob("castle", 1)->lease_expires_at, kNow + 2 * kLease);
  EXPECT_TRUE(absl::IsAborted(store().RenewLease("castle", 1, 1, "ant", kNow + 2 * kLease, kNow)));
  EXPECT_TRUE(absl::IsAborted(store().RenewLease("castle", 1, 2, "bee", kNow + 2 * kLease, kNow)));
  EXPECT_TRUE(absl::IsNotFound(store().RenewLease("castle", 9, 2, "ant", kNow + 2 * kLease, kNow)));
  // Run out, but nobody took it over: still the holder's.
  EXPECT_TRUE(store().RenewLease("castle", 1, 2, "ant", kNow + 9 * kLease, kNow + 5 * kLease).ok());
  ASSERT_TRUE(store().CompleteCameraJob("castle", 1, 2, Digest('a'), {}, "{}", kNow).ok());
  EXPECT_TRUE(absl::IsAborted(store().RenewLease("castle", 1, 2, "ant", kNow + 9 * kLease, kNow)));
}

TEST_P(JobStoreConformance, ALeaseThatRanOutIsTakenOverAndCountsAsAFailure) {
  AssignJobs("castle", 1);
  ASSERT_TRUE(store().LeaseCameraJobs(RequestOf("ant")).ok());
  EXPECT_TRUE(store().ListExpiredLeases(kNow + kLease - absl::Microseconds(1))->empty());
  EXPECT_THAT(Names(store().ListExpiredLeases(kNow + kLease)), testing::ElementsAre("castle/1"));
  const auto taken = store().LeaseCameraJobs(RequestOf("bee", kNow + kLease));
  ASSERT_EQ(taken->size(), 1);
  EXPECT_EQ(taken->at(0).job.epoch, 3);
  EXPECT_EQ(taken->at(0).job.failed_attempts, 1);
  EXPECT_THAT(taken->at(0).job.last_failure, testing::HasSubstr("ant"));
  // The old worker comes back with a stale result.
  EXPECT_TRUE(absl::IsAborted(store().RenewLease("castle", 1, 2, "ant", kNow + 9 * kLease, kNow)));
  EXPECT_TRUE(absl::IsAborted(store().CompleteCameraJob("castle", 1, 2, Digest('a'), {}, "{}", kNow)));
  EXPECT_TRUE(absl::IsAborted(store().ReleaseLease("castle", 1, 2, "ant", kNow)));
  EXPECT_TRUE(absl::IsAborted(store().FailLease("castle", 1, 2, "ant", {"crash"}, kNow)));
  EXPECT_TRUE(absl::IsAborted(store().ExpireLease("castle", 1, 2, {"ran out"}, kNow + 9 * kLease)));
  EXPECT_EQ(store().GetCameraJob("castle", 1)->lease_worker, "bee");
}

TEST_P(JobStoreConformance, AReleasedJobGoesBackWithoutAFailure) {
  AssignJobs("castle", 1);
  ASSERT_TRUE(store().LeaseCameraJobs(RequestOf("ant")).ok());
  EXPECT_TRUE(absl::IsAborted(store().ReleaseLease("castle", 1, 2, "bee", kNow)));
  EXPECT_TRUE(store().ReleaseLease("castle", 1, 2, "ant", kNow).ok());
  EXPECT_TRUE(store().ReleaseLease("castle", 1, 2, "ant", kNow).ok());
  const auto again = store().LeaseCameraJobs(RequestOf("bee"));
  ASSERT_EQ(again->size(), 1);
  EXPECT_EQ(again->at(0).job.failed_attempts, 0);
  EXPECT_EQ(again->at(0).job.epoch, 3);
}

TEST_P(JobStoreConformance, AFailedJobWaitsAndCounts) {
  AssignJobs("castle", 1);
  ASSERT_TRUE(store().LeaseCameraJobs(RequestOf("ant")).ok());
  const CameraJobFailure failure = {"ended with 137\xff", true, kNow + absl::Seconds(5)};
  EXPECT_TRUE(absl::IsAborted(store().FailLease("castle", 1, 2, "bee", failure, kNow)));
  EXPECT_TRUE(store().FailLease("castle", 1, 2, "ant", failure, kNow).ok());
  EXPECT_TRUE(store().FailLease("castle", 1, 2, "ant", failure, kNow).ok());
  EXPECT_TRUE(store().LeaseCameraJobs(RequestOf("ant", kNow + absl::Seconds(4)))->empty());
  const auto again = store().LeaseCameraJobs(RequestOf("ant", kNow + absl::Seconds(5)));
  ASSERT_EQ(again->size(), 1);
  EXPECT_EQ(again->at(0).job.failed_attempts, 1);
  EXPECT_EQ(again->at(0).job.out_of_memory_failures, 1);
  EXPECT_EQ(again->at(0).job.last_failure, "ended with 137?");
  EXPECT_EQ(again->at(0).job.not_before, kNow + absl::Seconds(5));
}

TEST_P(JobStoreConformance, OnlyALeaseThatRanOutExpires) {
  AssignJobs("castle", 1);
  ASSERT_TRUE(store().LeaseCameraJobs(RequestOf("ant")).ok());
  EXPECT_TRUE(absl::IsAborted(store().ExpireLease("castle", 1, 2, {"silent"}, kNow + kLease / 2)));
  EXPECT_TRUE(store().ExpireLease("castle", 1, 2, {"silent"}, kNow + kLease).ok());
  EXPECT_TRUE(store().ExpireLease("castle", 1, 2, {"silent"}, kNow + kLease).ok());
  EXPECT_TRUE(store().ListExpiredLeases(kNow + 9 * kLease)->empty());
  EXPECT_EQ(store().GetCameraJob("castle", 1)->failed_attempts, 1);
  EXPECT_EQ(store().GetCameraJob("castle", 1)->last_failure, "silent");
  // Nobody has taken it over: a late result is welcome.
  EXPECT_TRUE(store().CompleteCameraJob("castle", 1, 2, Digest('a'), {}, "{}", kNow).ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(store().ExpireLease("castle", 1, 2, {"silent"}, kNow + kLease)));
}

TEST_P(JobStoreConformance, LeasesAreListedByWorker) {
  AssignJobs("castle", 3);
  LeaseRequest request = RequestOf("ant");
  request.max_jobs = 2;
  ASSERT_TRUE(store().LeaseCameraJobs(request).ok());
  ASSERT_TRUE(store().LeaseCameraJobs(RequestOf("bee")).ok());
  EXPECT_THAT(Names(store().ListLeases("ant")), testing::ElementsAre("castle/1", "castle/2"));
  EXPECT_THAT(Names(store().ListLeases("bee")), testing::ElementsAre("castle/3"));
  EXPECT_EQ(Names(store().ListLeases("")).size(), 3);
}

// Two stores as two coordinators have them, several threads each: every job is leased exactly once.
TEST_P(JobStoreConformance, NoJobIsLeasedTwice) {
  constexpr int kJobs = 60;
  constexpr int kThreads = 4;
  AssignJobs("castle", kJobs);
  const std::unique_ptr<JobStore> other = fixture_.reopen();
  std::vector<std::vector<std::string>> got(kThreads);
  std::vector<std::thread> threads;
  threads.reserve(kThreads);
  for (int t = 0; t < kThreads; ++t) {
    threads.emplace_back([&, t] {
      JobStore& mine = t % 2 == 0 ? store() : *other;
      while (true) {
        const auto leases = Names(mine.LeaseCameraJobs(RequestOf("worker" + std::to_string(t))));
        if (leases.empty()) break;
        got[static_cast<size_t>(t)].push_back(leases.front());
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  std::set<std::string> all;
  size_t count = 0;
  for (const auto& names : got) {
    all.insert(names.begin(), names.end());
    count += names.size();
  }
  EXPECT_EQ(all.size(), kJobs);
  EXPECT_EQ(count, kJobs);
}

// Conductors.

TEST_P(JobStoreConformance, AReconstructionHasOneConductorAtATime) {
  EXPECT_THAT(*store().ListUnconductedReconstructions(kNow), testing::ElementsAre("castle"));
  EXPECT_TRUE(absl::IsNotFound(store().GetConductorLease("castle").status()));
  const auto first = store().AcquireConductorLease("castle", "north", kNow + kLease, kNow);
  ASSERT_TRUE(first.ok()) << first.status();
  EXPECT_EQ(*first, 1);
  EXPECT_TRUE(store().ListUnconductedReconstructions(kNow)->empty());
  const absl::Status refused = store().AcquireConductorLease("castle", "south", kNow + kLease, kNow).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(refused)) << refused;
  EXPECT_TRUE(store().RenewConductorLease("castle", 1, kNow + 2 * kLease, kNow).ok());
  EXPECT_FALSE(store().AcquireConductorLease("castle", "south", kNow + 3 * kLease, kNow + kLease).ok());
  Reopen();
  EXPECT_EQ(store().GetConductorLease("castle")->owner, "north");
  EXPECT_EQ(store().GetConductorLease("castle")->expires_at, kNow + 2 * kLease);
  EXPECT_THAT(*store().ListUnconductedReconstructions(kNow + 2 * kLease), testing::ElementsAre("castle"));
  EXPECT_EQ(*store().AcquireConductorLease("castle", "south", kNow + 9 * kLease, kNow + 2 * kLease), 2);
  EXPECT_TRUE(absl::IsAborted(store().RenewConductorLease("castle", 1, kNow + 9 * kLease, kNow)));
  // Given back: the next one need not wait. A release of an old epoch changes nothing.
  EXPECT_TRUE(store().ReleaseConductorLease("castle", 1, kNow).ok());
  EXPECT_TRUE(store().ListUnconductedReconstructions(kNow + 3 * kLease)->empty());
  EXPECT_TRUE(store().ReleaseConductorLease("castle", 2, kNow + 3 * kLease).ok());
  EXPECT_EQ(*store().AcquireConductorLease("castle", "north", kNow + 9 * kLease, kNow + 3 * kLease), 3);
  // A coordinator that was restarted under its name takes back what it held.
  EXPECT_EQ(*store().AcquireConductorLease("castle", "north", kNow + 9 * kLease, kNow + 3 * kLease), 4);
  EXPECT_TRUE(absl::IsNotFound(store().AcquireConductorLease("ruin", "north", kNow + kLease, kNow).status()));
  EXPECT_TRUE(absl::IsAborted(store().RenewConductorLease("ruin", 1, kNow + kLease, kNow)));
}

TEST_P(JobStoreConformance, OnlyTheConductorWrites) {
  ASSERT_EQ(*store().AcquireConductorLease("castle", "north", kNow + kLease, kNow), 1);
  ASSERT_TRUE(store().AssignCameraJob("castle", 1, 7, 0, kNow, 1).ok());
  ASSERT_TRUE(store().CompleteCameraJob("castle", 1, 1, Digest('a'), {}, "{}", kNow).ok());
  ASSERT_EQ(*store().AcquireConductorLease("castle", "south", kNow + 3 * kLease, kNow + 2 * kLease), 2);
  const Commit commit = {1, 7, Digest('b'), 9, 4};
  EXPECT_TRUE(absl::IsAborted(store().AddCommit("castle", commit, kNow, 1)));
  EXPECT_TRUE(absl::IsAborted(store().AssignCameraJob("castle", 2, 8, 0, kNow, 1)));
  EXPECT_TRUE(absl::IsAborted(store().AssignCameraJob("castle", 1, 7, 0, kNow, 1)));
  EXPECT_TRUE(absl::IsAborted(store().SetReconstructionState("castle", ReconstructionState::kDone, "", 1)));
  EXPECT_TRUE(store().ListCommits("castle")->empty());
  EXPECT_EQ(store().ListCameraJobs("castle")->size(), 1);
  EXPECT_TRUE(store().AddCommit("castle", commit, kNow, 2).ok());
  EXPECT_TRUE(store().AddCommit("castle", commit, kNow, 2).ok());
  EXPECT_TRUE(store().AssignCameraJob("castle", 2, 8, 0, kNow, 2).ok());
  EXPECT_TRUE(store().SetReconstructionState("castle", ReconstructionState::kDone, "", 2).ok());
  EXPECT_TRUE(store().ListUnconductedReconstructions(kNow + 9 * kLease)->empty());
  EXPECT_THAT(*store().ListCommits("castle"), testing::ElementsAre(commit));
}

TEST_P(JobStoreConformance, NobodyConductsInVainWhenManyTry) {
  constexpr int kThreads = 4;
  const std::unique_ptr<JobStore> other = fixture_.reopen();
  std::vector<int> won(kThreads, 0);
  std::vector<std::thread> threads;
  threads.reserve(kThreads);
  for (int t = 0; t < kThreads; ++t) {
    threads.emplace_back([&, t] {
      JobStore& mine = t % 2 == 0 ? store() : *other;
      const auto epoch = mine.AcquireConductorLease("castle", "c" + std::to_string(t), kNow + kLease, kNow);
      won[static_cast<size_t>(t)] = epoch.ok() ? 1 : 0;
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(won[0] + won[1] + won[2] + won[3], 1);
}

TEST_P(JobStoreConformance, CommitsAndChoicesAdvanceTogether) {
  ASSERT_EQ(*store().AcquireConductorLease("castle", "north", kNow + kLease, kNow), 1);
  ASSERT_TRUE(store().Advance("castle", {}, {{1, 7, 0, 5}, {2, 3, 0, 6}}, kNow, 1).ok());
  ASSERT_TRUE(store().Advance("castle", {}, {}, kNow, 1).ok());
  for (int s = 1; s <= 2; ++s) {
    ASSERT_TRUE(store().CompleteCameraJob("castle", s, 1, Digest('a'), {}, "{}", kNow).ok());
  }
  const std::vector<Commit> commits = {{1, 7, Digest('b'), 9, 4}, {2, 3, "", 0, 0}};
  const std::vector<CameraAssignment> choices = {{3, 5, 2, 0}};
  EXPECT_TRUE(absl::IsAborted(store().Advance("castle", commits, choices, kNow, 2)));
  EXPECT_TRUE(absl::IsFailedPrecondition(store().Advance("castle", {commits[1]}, choices, kNow, 1)));
  EXPECT_TRUE(store().ListCommits("castle")->empty());
  EXPECT_EQ(store().ListCameraJobs("castle")->size(), 2);
  EXPECT_TRUE(store().Advance("castle", commits, choices, kNow, 1).ok());
  EXPECT_TRUE(store().Advance("castle", commits, choices, kNow, 1).ok());
  // A part of it is there already.
  EXPECT_TRUE(store().Advance("castle", {commits[1]}, {{3, 5, 2, 0}, {4, 6, 2, 0}}, kNow, 1).ok());
  Reopen();
  EXPECT_THAT(*store().ListCommits("castle"), testing::ElementsAreArray(commits));
  EXPECT_EQ(store().ListCameraJobs("castle")->size(), 4);
  EXPECT_EQ(store().GetCameraJob("castle", 1)->memory_bytes, 5);
}

// The life of a reconstruction.

TEST_P(JobStoreConformance, AReconstructionRunsOnceItsSceneIsThere) {
  ASSERT_TRUE(store()
                  .CreateReconstruction({.id = "abbey",
                                         .options_json = "{}",
                                         .scene_digest = "",
                                         .state = ReconstructionState::kCreated,
                                         .weight = 3},
                                        kNow)
                  .ok());
  EXPECT_EQ(store().GetReconstruction("abbey")->weight, 3);
  EXPECT_TRUE(absl::IsFailedPrecondition(store().SetReconstructionState("abbey", ReconstructionState::kRunning)));
  EXPECT_TRUE(store().SetReconstructionScene("abbey", Digest('1')).ok());
  EXPECT_TRUE(store().SetReconstructionScene("abbey", Digest('2')).ok());
  EXPECT_TRUE(store().SetReconstructionState("abbey", ReconstructionState::kRunning).ok());
  EXPECT_TRUE(store().SetReconstructionScene("abbey", Digest('2')).ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(store().SetReconstructionScene("abbey", Digest('3'))));
  EXPECT_TRUE(absl::IsNotFound(store().SetReconstructionScene("ruin", Digest('3'))));
  EXPECT_EQ(store().GetReconstruction("abbey")->scene_digest, Digest('2'));
}

TEST_P(JobStoreConformance, FinalStatesStay) {
  ASSERT_TRUE(store().SetReconstructionState("castle", ReconstructionState::kFailed, "no pair is feasible").ok());
  EXPECT_TRUE(store().SetReconstructionState("castle", ReconstructionState::kFailed, "again").ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(store().SetReconstructionState("castle", ReconstructionState::kRunning)));
  EXPECT_TRUE(absl::IsFailedPrecondition(store().SetReconstructionState("castle", ReconstructionState::kDone)));
  EXPECT_EQ(store().GetReconstruction("castle")->state, ReconstructionState::kFailed);
  EXPECT_EQ(store().GetReconstruction("castle")->state_reason, "no pair is feasible");
}

TEST_P(JobStoreConformance, DeletingTakesEverythingAlong) {
  AssignJobs("castle", 2);
  ASSERT_TRUE(store().LeaseCameraJobs(RequestOf("ant")).ok());
  ASSERT_TRUE(store().SetCameraJobAside("castle", 1, 2, "gone", kNow).ok());
  ASSERT_TRUE(store().AddCommit("castle", {1, 1, "", 0, 0}, kNow).ok());
  ASSERT_TRUE(store().AcquireConductorLease("castle", "north", kNow + kLease, kNow).ok());
  EXPECT_TRUE(store().DeleteReconstruction("castle").ok());
  EXPECT_TRUE(store().DeleteReconstruction("castle").ok());
  EXPECT_TRUE(store().ListReconstructions()->empty());
  ASSERT_TRUE(store().CreateReconstruction(kReconstruction, kNow).ok());
  EXPECT_TRUE(store().ListCameraJobs("castle")->empty());
  EXPECT_TRUE(store().ListCommits("castle")->empty());
  EXPECT_TRUE(absl::IsNotFound(store().GetConductorLease("castle").status()));
}

TEST_P(JobStoreConformance, ListsCanBeReadInPieces) {
  for (const char* id : {"abbey", "barn"}) {
    ASSERT_TRUE(store().CreateReconstruction({id, "{}", Digest('1')}, kNow).ok());
  }
  EXPECT_EQ(store().ListReconstructions("", 2)->size(), 2);
  const auto rest = store().ListReconstructions("barn", 2);
  ASSERT_EQ(rest->size(), 1);
  EXPECT_EQ(rest->front().id, "castle");
  AssignJobs("castle", 3);
  const auto jobs = store().ListCameraJobs("castle", 1);
  ASSERT_EQ(jobs->size(), 2);
  EXPECT_EQ(jobs->front().sequence, 2);
  for (int s = 1; s <= 3; ++s) {
    ASSERT_TRUE(store().SetCameraJobAside("castle", s, 1, "gone", kNow).ok());
    ASSERT_TRUE(store().AddCommit("castle", {s, s, "", 0, 0}, kNow).ok());
  }
  EXPECT_THAT(*store().ListCommits("castle", 2), testing::ElementsAre(Commit{3, 3, "", 0, 0}));
}

TEST_P(JobStoreConformance, TextIsKeptAsItIs) {
  const std::string odd = "'; DROP TABLE reconstructions; -- \\ $1 :id % \xc3\xa9\n";
  ASSERT_TRUE(store().CreateReconstruction({odd, "{ \"b\" : 1,\n \"a\":2}", Digest('1')}, kNow).ok());
  const auto stored = store().GetReconstruction(odd);
  ASSERT_TRUE(stored.ok()) << stored.status();
  EXPECT_EQ(stored->id, odd);
  EXPECT_EQ(stored->options_json, "{ \"b\" : 1,\n \"a\":2}");
  AssignJobs(odd, 1);
  ASSERT_TRUE(store().SetCameraJobAside(odd, 1, 1, std::string("a\0b\xe2\x82", 5), kNow).ok());
  EXPECT_EQ(store().GetCameraJob(odd, 1)->set_aside_reason, "a?b??");
}

// Workers.

TEST_P(JobStoreConformance, WorkersAreKnownByTheirHeartbeats) {
  EXPECT_TRUE(absl::IsNotFound(store().SetWorkerDrained("ant", true)));
  ASSERT_TRUE(store().RecordHeartbeat("bee", 4, 8'000'000'000, kNow).ok());
  ASSERT_TRUE(store().RecordHeartbeat("ant", 2, 1'000, kNow).ok());
  ASSERT_TRUE(store().SetWorkerDrained("ant", true).ok());
  ASSERT_TRUE(store().RecordHeartbeat("ant", 3, 2'000, kNow + kLease).ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(store().RecordHeartbeat("", 3, 2'000, kNow)));
  EXPECT_TRUE(absl::IsFailedPrecondition(store().RecordHeartbeat("cat", -1, 2'000, kNow)));
  Reopen();
  const auto workers = store().ListWorkers();
  ASSERT_TRUE(workers.ok());
  ASSERT_EQ(workers->size(), 2);
  EXPECT_EQ(workers->at(0).id, "ant");
  EXPECT_EQ(workers->at(0).cores, 3);
  EXPECT_EQ(workers->at(0).memory_bytes, 2'000);
  EXPECT_EQ(workers->at(0).last_heartbeat, kNow + kLease);
  EXPECT_TRUE(workers->at(0).drained);
  EXPECT_EQ(workers->at(1).id, "bee");
  EXPECT_EQ(workers->at(1).memory_bytes, 8'000'000'000);
  EXPECT_FALSE(workers->at(1).drained);
  EXPECT_TRUE(store().RemoveWorker("ant").ok());
  EXPECT_TRUE(store().RemoveWorker("ant").ok());
  EXPECT_EQ(store().ListWorkers()->size(), 1);
}

}  // namespace meshwright
