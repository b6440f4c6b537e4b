// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <map>
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

  // Of a conductor's lease, which is taken at the first call.
  int64_t Conduct(const std::string& id) {
    const auto found = epochs_.find(id);
    if (found != epochs_.end()) return found->second;
    return epochs_[id] = store().AcquireConductorLease(id, "north", kNow + kLease, kNow).value_or(1);
  }
  absl::Status Assign(const std::string& id, const CameraAssignment& assignment) {
    return store().Advance(id, {}, {assignment}, {}, kNow, Conduct(id));
  }
  absl::Status AddCommit(const std::string& id, const Commit& commit) {
    return store().Advance(id, {commit}, {}, {}, kNow, Conduct(id));
  }
  absl::Status SetState(const std::string& id, ReconstructionState state, const std::string& reason = "") {
    return store().SetReconstructionState(id, state, reason, kNow, Conduct(id));
  }
  absl::Status SetScene(const std::string& id, const std::string& digest) {
    return store().SetReconstructionScene(id, digest, "", Conduct(id));
  }

  // Cameras 1 .. count as jobs 1 .. count.
  void AssignJobs(const std::string& id, int count) {
    for (int s = 1; s <= count; ++s) ASSERT_TRUE(Assign(id, {s, s, 0}).ok());
  }

  // A change of castle's job `sequence` as `worker` would make it.
  static JobChange ChangeOf(JobChange::Kind kind, SequenceNumber sequence, int64_t epoch, const std::string& worker) {
    return {.kind = kind,
            .id = "castle",
            .sequence = sequence,
            .epoch = epoch,
            .worker = worker,
            .instance = "1",
            .expires_at = kNow + kLease};
  }
  JobChangeResult Apply(const JobChange& change, absl::Time now = kNow) {
    const auto results = store().ApplyChanges({change}, {}, now);
    if (!results.ok()) return {.status = results.status()};
    return results->front();
  }
  JobChangeResult Claim(SequenceNumber sequence, int64_t epoch, const std::string& worker, absl::Time now = kNow) {
    JobChange change = ChangeOf(JobChange::Kind::kClaim, sequence, epoch, worker);
    change.expires_at = now + kLease;
    return Apply(change, now);
  }
  absl::Status End(JobChange::Kind kind, SequenceNumber sequence, int64_t epoch, const std::string& worker,
                   const std::string& reason = "") {
    JobChange change = ChangeOf(kind, sequence, epoch, worker);
    change.reason = reason;
    return Apply(change).status;
  }
  absl::Status Complete(const std::string& id, SequenceNumber sequence, int64_t epoch, const std::string& digest,
                        const std::vector<CameraIndex>& weak_targets = {}, const std::string& report_json = "{}") {
    JobChange change = ChangeOf(JobChange::Kind::kComplete, sequence, epoch, "");
    change.id = id;
    change.filtered_digest = digest;
    change.weak_targets = weak_targets;
    change.report_json = report_json;
    return Apply(change).status;
  }
  absl::Status Complete(SequenceNumber sequence, int64_t epoch, const std::string& digest) {
    return Complete("castle", sequence, epoch, digest);
  }
  absl::Status Skip(const std::string& id, SequenceNumber sequence, int64_t epoch, const std::string& reason) {
    JobChange change = ChangeOf(JobChange::Kind::kSkipped, sequence, epoch, "");
    change.id = id;
    change.reason = reason;
    return Apply(change).status;
  }

  static constexpr absl::Duration kLease = absl::Seconds(30);
  static inline const absl::Time kNow = absl::FromUnixSeconds(1'000'000'000);
  static inline const Reconstruction kReconstruction = {
      .id = "castle", .options_json = R"({"window":3})", .scene_digest = std::string(64, '0')};

  JobStoreFixture fixture_;
  std::map<std::string, int64_t> epochs_;
};

TEST_P(JobStoreConformance, ReconstructionsSurviveReopening) {
  Reopen();
  const auto stored = store().GetReconstruction("castle");
  ASSERT_TRUE(stored.ok()) << stored.status();
  EXPECT_EQ(stored->options_json, kReconstruction.options_json);
  EXPECT_EQ(stored->scene_digest, kReconstruction.scene_digest);
  EXPECT_EQ(stored->state, ReconstructionState::kRunning);

  ASSERT_TRUE(SetState("castle", ReconstructionState::kDone).ok());
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

TEST_P(JobStoreConformance, OwnersSeeAndCountTheirOwn) {
  for (const char* id : {"abbey", "mill", "tower"}) {
    ASSERT_TRUE(store()
                    .CreateReconstruction({.id = id,
                                           .options_json = "{}",
                                           .state = ReconstructionState::kCreated,
                                           .owner = std::string(id) == "mill" ? "bob" : "alice"},
                                          kNow)
                    .ok());
  }
  Reopen();
  EXPECT_EQ(store().GetReconstruction("abbey")->owner, "alice");
  EXPECT_EQ(store().GetReconstruction("castle")->owner, "");
  const auto all = store().ListReconstructionsOf("alice", "", 10);
  ASSERT_TRUE(all.ok()) << all.status();
  ASSERT_EQ(all->size(), 2U);
  EXPECT_EQ(all->at(0).id, "abbey");
  EXPECT_EQ(store().ListReconstructionsOf("alice", "abbey", 10)->at(0).id, "tower");
  EXPECT_EQ(store().ListReconstructionsOf("alice", "", 1)->size(), 1U);
  ASSERT_TRUE(store().PutSceneFile("abbey", {"a", 100, Digest('a')}).ok());
  ASSERT_TRUE(store().PutSceneFile("tower", {"b", 11, Digest('b')}).ok());
  ASSERT_TRUE(store().PutSceneFile("mill", {"c", 5, Digest('c')}).ok());
  EXPECT_EQ(store().UsageOf("alice")->reconstructions, 2);
  EXPECT_EQ(store().UsageOf("alice")->scene_bytes, 111);
  ASSERT_TRUE(store().BeginDeletion("tower").ok());
  EXPECT_EQ(store().UsageOf("alice")->scene_bytes, 100);
  EXPECT_EQ(store().UsageOf("nobody")->reconstructions, 0);
}

TEST_P(JobStoreConformance, KeysAreKeptUntilLongAfterTheirEnd) {
  const AccessToken key = {.id = "k1", .digest = Digest('1'), .user = "alice", .role = "submitter", .created_at = kNow};
  AccessToken link = {.id = "k2",
                      .digest = Digest('2'),
                      .user = "alice",
                      .role = "viewer",
                      .reconstruction_id = "castle",
                      .created_at = kNow + absl::Seconds(1),
                      .expires_at = kNow + absl::Hours(1)};
  ASSERT_TRUE(store().CreateToken(link).ok());
  ASSERT_TRUE(store().CreateToken(key).ok());
  EXPECT_TRUE(absl::IsAlreadyExists(store().CreateToken(key)));
  EXPECT_FALSE(store().CreateToken({.id = "k3", .digest = Digest('3'), .user = "x", .role = "king"}).ok());
  Reopen();
  EXPECT_THAT(*store().ListTokens(), testing::ElementsAre(key, link));
  EXPECT_TRUE(absl::IsNotFound(store().GetToken("k4").status()));
  EXPECT_TRUE(absl::IsNotFound(store().RevokeToken("k4", kNow)));
  link.revoked_at = kNow + absl::Seconds(2);
  ASSERT_TRUE(store().RevokeToken("k2", link.revoked_at).ok());
  ASSERT_TRUE(store().RevokeToken("k2", kNow + absl::Hours(9)).ok());
  EXPECT_EQ(*store().GetToken("k2"), link);
  ASSERT_TRUE(store().RemoveDeadTokens(link.revoked_at).ok());
  EXPECT_EQ(store().ListTokens()->size(), 2U);
  ASSERT_TRUE(store().RemoveDeadTokens(kNow + absl::Seconds(3)).ok());
  EXPECT_THAT(*store().ListTokens(), testing::ElementsAre(key));
}

TEST_P(JobStoreConformance, ReconstructionIdsAreUnique) {
  EXPECT_TRUE(absl::IsAlreadyExists(store().CreateReconstruction(kReconstruction, kNow)));
}

TEST_P(JobStoreConformance, UnknownReconstructionsAreNotFound) {
  EXPECT_TRUE(absl::IsNotFound(store().GetReconstruction("ruin").status()));
  EXPECT_FALSE(SetState("ruin", ReconstructionState::kDone).ok());
  EXPECT_FALSE(Assign("ruin", {1, 0, 0}).ok());
  EXPECT_TRUE(absl::IsNotFound(store().RequestState("ruin", ReconstructionState::kCancelled, kNow)));
  EXPECT_TRUE(absl::IsAborted(Complete("ruin", 1, 1, Digest('a'))));
}

TEST_P(JobStoreConformance, ValuesThatBreakAnInvariantAreRefused) {
  EXPECT_FALSE(store().CreateReconstruction({"", "{}", Digest('1')}, kNow).ok());
  EXPECT_FALSE(store().CreateReconstruction({"x", "not json", Digest('1')}, kNow).ok());
  EXPECT_FALSE(store().CreateReconstruction({"x", "{}", "short"}, kNow).ok());
  EXPECT_FALSE(Assign("castle", {0, 1, 0}).ok());   // sequences begin at 1
  EXPECT_FALSE(Assign("castle", {1, -1, 0}).ok());  // no such camera
  EXPECT_FALSE(Assign("castle", {2, 1, 2}).ok());   // sees itself
  ASSERT_TRUE(Assign("castle", {1, 4, 0}).ok());
  EXPECT_FALSE(Complete("castle", 1, 1, "short").ok());
  EXPECT_FALSE(Complete("castle", 1, 1, Digest('a'), {}, "not json").ok());
  ASSERT_TRUE(Complete("castle", 1, 1, Digest('a')).ok());
  EXPECT_FALSE(AddCommit("castle", {1, 4, Digest('b'), 5, 6}).ok());  // more accepted than filtered
  EXPECT_FALSE(AddCommit("castle", {1, 4, "", 5, 5}).ok());           // accepted, but where?
  EXPECT_FALSE(AddCommit("castle", {1, 9, Digest('b'), 5, 5}).ok());  // another camera
  EXPECT_TRUE(store().ListCommits("castle")->empty());
}

TEST_P(JobStoreConformance, AssignmentsAreIdempotentAndContradictionsRefused) {
  ASSERT_TRUE(Assign("castle", {1, 7, 0}).ok());
  EXPECT_TRUE(Assign("castle", {1, 7, 0}).ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(Assign("castle", {1, 8, 0})));
  EXPECT_TRUE(absl::IsFailedPrecondition(Assign("castle", {2, 7, 0})));  // one job a camera
  const auto jobs = store().ListCameraJobs("castle");
  ASSERT_EQ(jobs->size(), 1);
  EXPECT_EQ(jobs->at(0).camera, 7);
  EXPECT_EQ(jobs->at(0).epoch, 1);
  EXPECT_EQ(jobs->at(0).state, CameraJobState::kAssigned);
}

TEST_P(JobStoreConformance, ResultsSurviveReopening) {
  ASSERT_TRUE(Assign("castle", {1, 7, 0}).ok());
  ASSERT_TRUE(Assign("castle", {2, 3, 0}).ok());
  ASSERT_TRUE(Complete("castle", 2, 1, Digest('a'), {4, 11}, R"({"seeds":9})").ok());
  ASSERT_TRUE(Skip("castle", 1, 1, "picture is gone").ok());
  Reopen();
  const auto jobs = store().ListCameraJobs("castle");
  ASSERT_TRUE(jobs.ok());
  ASSERT_EQ(jobs->size(), 2);
  EXPECT_EQ(jobs->at(0).state, CameraJobState::kSkipped);
  EXPECT_EQ(jobs->at(0).skip_reason, "picture is gone");
  EXPECT_EQ(jobs->at(1).state, CameraJobState::kDone);
  EXPECT_EQ(jobs->at(1).filtered_digest, Digest('a'));
  EXPECT_THAT(jobs->at(1).weak_targets, testing::ElementsAre(4, 11));
  EXPECT_EQ(jobs->at(1).report_json, R"({"seeds":9})");
}

TEST_P(JobStoreConformance, AnOldEpochMayNotWrite) {
  ASSERT_TRUE(Assign("castle", {1, 7, 0}).ok());
  ASSERT_EQ(Claim(1, 1, "ant").job->epoch, 2);
  EXPECT_TRUE(absl::IsAborted(Complete(1, 1, Digest('a'))));
  EXPECT_TRUE(absl::IsAborted(Skip("castle", 1, 1, "slow")));
  EXPECT_EQ(store().ListCameraJobs("castle")->at(0).state, CameraJobState::kAssigned);
  EXPECT_TRUE(Complete(1, 2, Digest('b')).ok());
  // Finished jobs are not handed out any more, and who comes late learns that it may drop its work.
  EXPECT_TRUE(absl::IsAborted(Claim(1, 2, "ant").status));
  EXPECT_TRUE(absl::IsAborted(Complete(1, 1, Digest('a'))));
  EXPECT_EQ(store().ListCameraJobs("castle")->at(0).filtered_digest, Digest('b'));
}

TEST_P(JobStoreConformance, TheFirstResultStays) {
  ASSERT_TRUE(Assign("castle", {1, 7, 0}).ok());
  ASSERT_TRUE(Complete(1, 1, Digest('a')).ok());
  EXPECT_TRUE(absl::IsAborted(Complete(1, 1, Digest('a'))));
  EXPECT_TRUE(absl::IsAborted(Complete(1, 1, Digest('b'))));
  EXPECT_TRUE(absl::IsAborted(Skip("castle", 1, 1, "slow")));
  EXPECT_EQ(store().GetCameraJob("castle", 1)->filtered_digest, Digest('a'));
}

TEST_P(JobStoreConformance, CommitsComeInOrderOnceAndOfFinishedJobs) {
  ASSERT_TRUE(Assign("castle", {1, 7, 0}).ok());
  ASSERT_TRUE(Assign("castle", {2, 3, 0}).ok());
  ASSERT_TRUE(Complete("castle", 2, 1, Digest('a')).ok());
  const Commit first = {1, 7, "", 0, 0};
  const Commit second = {2, 3, Digest('b'), 9, 4};
  EXPECT_TRUE(absl::IsFailedPrecondition(AddCommit("castle", second)));  // 1 is missing
  EXPECT_TRUE(absl::IsFailedPrecondition(AddCommit("castle", first)));   // not finished
  ASSERT_TRUE(Skip("castle", 1, 1, "gone").ok());
  EXPECT_TRUE(AddCommit("castle", first).ok());
  EXPECT_TRUE(AddCommit("castle", second).ok());
  EXPECT_TRUE(AddCommit("castle", second).ok());  // again: harmless
  EXPECT_TRUE(absl::IsFailedPrecondition(AddCommit("castle", {2, 3, Digest('c'), 9, 4})));
  Reopen();
  const auto commits = store().ListCommits("castle");
  ASSERT_TRUE(commits.ok());
  EXPECT_THAT(*commits, testing::ElementsAre(first, second));
}

TEST_P(JobStoreConformance, ReconstructionsDoNotSeeEachOther) {
  ASSERT_TRUE(store().CreateReconstruction({"abbey", "{}", Digest('1')}, kNow).ok());
  ASSERT_TRUE(Assign("abbey", {1, 2, 0}).ok());
  ASSERT_TRUE(Assign("castle", {1, 7, 0}).ok());
  EXPECT_EQ(store().ListCameraJobs("abbey")->at(0).camera, 2);
  EXPECT_EQ(store().ListCameraJobs("castle")->at(0).camera, 7);
}

TEST_P(JobStoreConformance, ManyThreadsGetOneWinnerEach) {
  constexpr int kJobs = 8;
  constexpr int kThreads = 4;
  for (int s = 1; s <= kJobs; ++s) ASSERT_TRUE(Assign("castle", {s, s, 0}).ok());
  std::vector<int> won(kThreads, 0);
  std::vector<std::thread> threads;
  threads.reserve(kThreads);
  for (int t = 0; t < kThreads; ++t) {
    threads.emplace_back([&, t] {
      for (int s = 1; s <= kJobs; ++s) {
        const std::string digest = Digest(static_cast<char>('a' + t));
        if (Complete("castle", s, 1, digest).ok()) ++won[static_cast<size_t>(t)];
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
  ASSERT_TRUE(Assign("castle", {1, 7, 0, 5, {2, 9}, "what to do"}).ok());
  const JobChangeResult claimed = Claim(1, 1, "ant");
  ASSERT_TRUE(claimed.status.ok() && claimed.job.has_value()) << claimed.status;
  EXPECT_EQ(claimed.job->epoch, 2);
  EXPECT_EQ(claimed.job->camera, 7);
  EXPECT_EQ(claimed.job->spec, "what to do");
  EXPECT_THAT(claimed.job->neighbours, testing::ElementsAre(2, 9));
  EXPECT_EQ(claimed.job->lease_worker, "ant");
  EXPECT_EQ(claimed.job->lease_instance, "1");
  EXPECT_EQ(claimed.job->leased_at, kNow);
  EXPECT_EQ(claimed.job->lease_expires_at, kNow + kLease);
  EXPECT_TRUE(absl::IsAborted(Claim(1, 1, "bee").status));
  EXPECT_TRUE(absl::IsAborted(Claim(1, 2, "bee").status));
  Reopen();
  EXPECT_TRUE(absl::IsAborted(Claim(1, 2, "bee").status));
  EXPECT_TRUE(absl::IsAborted(Complete(1, 1, Digest('a'))));
  EXPECT_TRUE(Complete(1, 2, Digest('a')).ok());
  EXPECT_EQ(store().GetCameraJob("castle", 1)->lease_worker, "");
  EXPECT_EQ(store().GetCameraJob("castle", 1)->spec, "what to do");
  EXPECT_TRUE(store().ListOpenJobs()->empty());
}

TEST_P(JobStoreConformance, OpenJobsAreThoseOfReconstructionsThatRun) {
  ASSERT_TRUE(
      store()
          .CreateReconstruction(
              {.id = "abbey", .options_json = "{}", .scene_digest = Digest('1'), .weight = 2.5, .method_version = 7},
              kNow)
          .ok());
  ASSERT_TRUE(Assign("castle", {1, 7, 0, 5'000'000'000}).ok());
  ASSERT_TRUE(Assign("castle", {2, 3, 0}).ok());
  ASSERT_TRUE(Assign("abbey", {1, 4, 0}).ok());
  ASSERT_TRUE(Claim(2, 1, "ant").status.ok());
  const auto open = store().ListOpenJobs();
  ASSERT_TRUE(open.ok()) << open.status();
  ASSERT_EQ(open->size(), 3);
  EXPECT_EQ(open->at(0).reconstruction_id, "abbey");
  EXPECT_EQ(open->at(0).weight, 2.5);
  EXPECT_EQ(open->at(0).method_version, 7);
  EXPECT_EQ(open->at(1).method_version, kMethodVersion);
  EXPECT_EQ(store().GetReconstruction("abbey")->method_version, 7);
  EXPECT_EQ(store().ListConducted()->at(0).method_version, 7);
  EXPECT_EQ(open->at(1).camera, 7);
  EXPECT_EQ(open->at(1).memory_bytes, 5'000'000'000);
  EXPECT_EQ(open->at(1).lease_worker, "");
  EXPECT_EQ(open->at(2).lease_worker, "ant");
  EXPECT_EQ(open->at(2).lease_expires_at, kNow + kLease);
  EXPECT_EQ(open->at(2).epoch, 2);
  ASSERT_TRUE(store().RequestState("castle", ReconstructionState::kCancelled, kNow).ok());
  ASSERT_EQ(store().ListOpenJobs()->size(), 1);
}

TEST_P(JobStoreConformance, ScenesArePreparedBeforeTheyRunByJobsThatAreNoCameras) {
  for (const SequenceNumber preparation : {kCameraEstimation, kCameraRefinement}) {
    Reconstruction prepared = kReconstruction;
    prepared.id = absl::StrCat("photographs-", preparation);
    prepared.state = ReconstructionState::kPreparing;
    ASSERT_TRUE(store().CreateReconstruction(prepared, kNow).ok());
    ASSERT_TRUE(Assign(prepared.id, {.sequence = preparation, .camera = preparation, .spec = "[]"}).ok());
    const auto open = store().ListOpenJobs();
    ASSERT_TRUE(open.ok()) << open.status();
    ASSERT_EQ(open->size(), 1);
    EXPECT_EQ(open->front().sequence, preparation);
    ASSERT_TRUE(Complete(prepared.id, preparation, 1, Digest('e')).ok());
    EXPECT_TRUE(store().ListCameraJobs(prepared.id)->empty());
    EXPECT_TRUE(store().ListResults(prepared.id)->empty());
    const auto job = store().GetCameraJob(prepared.id, preparation);
    ASSERT_TRUE(job.ok()) << job.status();
    EXPECT_EQ(job->state, CameraJobState::kDone);
    EXPECT_EQ(job->filtered_digest, Digest('e'));
  }
}

TEST_P(JobStoreConformance, OnlyTheHolderRenews) {
  AssignJobs("castle", 1);
  ASSERT_TRUE(Claim(1, 1, "ant").status.ok());
  JobChange renewal = ChangeOf(JobChange::Kind::kRenew, 1, 2, "ant");
  renewal.expires_at = kNow + 2 * kLease;
  EXPECT_TRUE(Apply(renewal).status.ok());
  EXPECT_EQ(store().GetCameraJob("castle", 1)->lease_expires_at, kNow + 2 * kLease);
  renewal.epoch = 1;
  EXPECT_TRUE(absl::IsAborted(Apply(renewal).status));
  renewal.epoch = 2;
  renewal.worker = "bee";
  EXPECT_TRUE(absl::IsAborted(Apply(renewal).status));
  renewal.sequence = 9;
  EXPECT_TRUE(absl::IsAborted(Apply(renewal).status));
}

TEST_P(JobStoreConformance, AReleasedJobGoesBackWithoutAFailure) {
  AssignJobs("castle", 1);
  ASSERT_TRUE(Claim(1, 1, "ant").status.ok());
  EXPECT_TRUE(absl::IsAborted(End(JobChange::Kind::kRelease, 1, 2, "bee")));
  EXPECT_TRUE(End(JobChange::Kind::kRelease, 1, 2, "ant").ok());
  EXPECT_TRUE(absl::IsAborted(End(JobChange::Kind::kRelease, 1, 2, "ant")));
  const JobChangeResult again = Claim(1, 2, "bee");
  ASSERT_TRUE(again.job.has_value());
  EXPECT_EQ(again.job->failed_attempts, 0);
  EXPECT_EQ(again.job->losses, 0);
  EXPECT_EQ(again.job->epoch, 3);
}

TEST_P(JobStoreConformance, AFailedJobWaitsAndCounts) {
  AssignJobs("castle", 1);
  ASSERT_TRUE(Claim(1, 1, "ant").status.ok());
  JobChange failure = ChangeOf(JobChange::Kind::kFail, 1, 2, "ant");
  failure.reason = "ended with 137\xff";
  failure.out_of_memory = true;
  failure.reduce = true;
  failure.memory_bytes = 77;
  failure.retry_at = kNow + absl::Seconds(5);
  EXPECT_TRUE(Apply(failure).status.ok());
  EXPECT_TRUE(absl::IsAborted(Apply(failure).status));  // counts once
  const CameraJob job = *store().GetCameraJob("castle", 1);
  EXPECT_EQ(job.failed_attempts, 1);
  EXPECT_EQ(job.out_of_memory_failures, 1);
  EXPECT_EQ(job.reduction, 1);
  EXPECT_EQ(job.memory_bytes, 77);
  EXPECT_EQ(job.last_failure, "ended with 137?");
  EXPECT_EQ(store().ListOpenJobs()->at(0).not_before, kNow + absl::Seconds(5));
  EXPECT_EQ(store().ListOpenJobs()->at(0).failed_attempts, 1);
  EXPECT_EQ(store().ListOpenJobs()->at(0).reduction, 1);
}

TEST_P(JobStoreConformance, OnlyALeaseThatRanOutIsTakenAway) {
  AssignJobs("castle", 1);
  ASSERT_TRUE(Claim(1, 1, "ant").status.ok());
  JobChange loss = ChangeOf(JobChange::Kind::kLose, 1, 2, "ant");
  loss.reason = "silent";
  loss.only_if_expired_at = kNow + kLease / 2;
  EXPECT_TRUE(absl::IsAborted(Apply(loss).status));
  loss.only_if_expired_at = kNow + kLease;
  EXPECT_TRUE(Apply(loss).status.ok());
  EXPECT_TRUE(absl::IsAborted(Apply(loss).status));
  EXPECT_EQ(store().GetCameraJob("castle", 1)->losses, 1);
  EXPECT_EQ(store().GetCameraJob("castle", 1)->failed_attempts, 0);
  EXPECT_EQ(store().GetCameraJob("castle", 1)->last_failure, "silent");
  // Nobody has taken it over: a late result is welcome, once.
  EXPECT_TRUE(Complete(1, 2, Digest('a')).ok());
  EXPECT_TRUE(absl::IsAborted(Complete(1, 2, Digest('b'))));
  EXPECT_EQ(store().GetCameraJob("castle", 1)->filtered_digest, Digest('a'));
}

TEST_P(JobStoreConformance, AWorkerThatComesBackWithAStaleResultIsRefused) {
  AssignJobs("castle", 1);
  ASSERT_TRUE(Claim(1, 1, "ant").status.ok());
  ASSERT_TRUE(End(JobChange::Kind::kLose, 1, 2, "ant", "silent").ok());
  ASSERT_TRUE(Claim(1, 2, "bee").status.ok());
  EXPECT_TRUE(absl::IsAborted(Complete(1, 2, Digest('a'))));
  for (const JobChange::Kind kind : {JobChange::Kind::kRenew, JobChange::Kind::kRelease, JobChange::Kind::kFail,
                                     JobChange::Kind::kLose, JobChange::Kind::kSkipped}) {
    EXPECT_TRUE(absl::IsAborted(End(kind, 1, 2, "ant", "crash"))) << static_cast<int>(kind);
  }
  EXPECT_EQ(store().GetCameraJob("castle", 1)->lease_worker, "bee");
  EXPECT_TRUE(Complete(1, 3, Digest('b')).ok());
}

TEST_P(JobStoreConformance, AChangeThatCannotBeStoredLeavesTheOthersAlone) {
  AssignJobs("castle", 3);
  std::vector<JobChange> changes;
  for (int s = 1; s <= 3; ++s) {
    changes.push_back(ChangeOf(JobChange::Kind::kComplete, s, 1, ""));
    changes.back().filtered_digest = s == 2 ? "short" : Digest('a');
    changes.back().report_json = "{}";
  }
  const auto results = store().ApplyChanges(changes, {{.id = "ant", .cores = 2, .last_heartbeat = kNow}}, kNow);
  ASSERT_TRUE(results.ok()) << results.status();
  EXPECT_TRUE(results->at(0).status.ok());
  EXPECT_FALSE(results->at(1).status.ok());
  EXPECT_TRUE(results->at(2).status.ok());
  EXPECT_EQ(store().ListResults("castle")->size(), 2);
  EXPECT_EQ(store().ListWorkers()->size(), 1);
}

TEST_P(JobStoreConformance, AttemptsAreRemembered) {
  AssignJobs("castle", 2);
  EXPECT_TRUE(store().ListAttempts("castle", 10)->empty());
  ASSERT_TRUE(Claim(1, 1, "ant").status.ok());
  ASSERT_TRUE(End(JobChange::Kind::kFail, 1, 2, "ant", "crash").ok());
  ASSERT_TRUE(Claim(1, 2, "bee", kNow + kLease).status.ok());
  JobChange done = ChangeOf(JobChange::Kind::kComplete, 1, 3, "");
  done.filtered_digest = Digest('a');
  done.report_json = "{}";
  ASSERT_TRUE(Apply(done, kNow + 2 * kLease).status.ok());
  ASSERT_TRUE(Claim(2, 1, "ant", kNow - kLease).status.ok());
  ASSERT_TRUE(End(JobChange::Kind::kSkipped, 2, 2, "", "poison").ok());
  const auto attempts = store().ListAttempts("castle", 10);
  ASSERT_TRUE(attempts.ok()) << attempts.status();
  ASSERT_EQ(attempts->size(), 3);
  EXPECT_EQ(attempts->at(0).worker, "bee");
  EXPECT_EQ(attempts->at(0).ending, "finished");
  EXPECT_EQ(attempts->at(0).began_at, kNow + kLease);
  EXPECT_EQ(attempts->at(0).ended_at, kNow + 2 * kLease);
  EXPECT_EQ(attempts->at(1).ending, "failed");
  EXPECT_EQ(attempts->at(1).reason, "crash");
  EXPECT_EQ(attempts->at(2).camera, 2);
  EXPECT_EQ(attempts->at(2).reason, "poison");
  EXPECT_EQ(store().ListAttempts("castle", 1)->size(), 1);
  // Only so many of one job.
  AssignJobs("castle", 3);
  for (int64_t epoch = 1; epoch <= 40; ++epoch) {
    ASSERT_TRUE(Claim(3, epoch, "ant").status.ok());
    ASSERT_TRUE(End(JobChange::Kind::kRelease, 3, epoch + 1, "ant").ok());
  }
  EXPECT_EQ(store().ListAttempts("castle", 100)->size(), 3 + 16);
}

TEST_P(JobStoreConformance, AResultThatIsLostIsMadeAgainAndMustBeTheSame) {
  AssignJobs("castle", 1);
  ASSERT_TRUE(Claim(1, 1, "ant").status.ok());
  ASSERT_TRUE(End(JobChange::Kind::kFail, 1, 2, "ant", "crash").ok());
  ASSERT_TRUE(Complete("castle", 1, 2, Digest('a'), {3}, "{}").ok());
  ASSERT_TRUE(AddCommit("castle", {1, 1, Digest('b'), 9, 4}).ok());
  EXPECT_TRUE(
      absl::IsAborted(store().ReopenCameraJob("castle", 1, 1, Digest('a'), "damaged", kNow, Conduct("castle"))));
  ASSERT_TRUE(store().ReopenCameraJob("castle", 1, 2, Digest('a'), "damaged", kNow, Conduct("castle")).ok());
  EXPECT_TRUE(
      absl::IsAborted(store().ReopenCameraJob("castle", 1, 2, Digest('a'), "damaged", kNow, Conduct("castle"))));
  const auto open = store().ListOpenJobs();
  ASSERT_EQ(open->size(), 1);
  EXPECT_TRUE(open->at(0).is_repair);
  EXPECT_EQ(open->at(0).failed_attempts, 0);
  EXPECT_EQ(open->at(0).epoch, 3);
  EXPECT_EQ(store().GetCameraJob("castle", 1)->expected_digest, Digest('a'));
  ASSERT_TRUE(Claim(1, 3, "bee").status.ok());
  EXPECT_FALSE(End(JobChange::Kind::kSkipped, 1, 4, "bee", "poison").ok());
  EXPECT_FALSE(Complete(1, 4, Digest('c')).ok());
  EXPECT_TRUE(Complete(1, 4, Digest('a')).ok());
  EXPECT_EQ(store().GetCameraJob("castle", 1)->state, CameraJobState::kDone);
  EXPECT_EQ(store().GetCameraJob("castle", 1)->expected_digest, "");
}

TEST_P(JobStoreConformance, AResultThatIsNoneIsTakenBack) {
  AssignJobs("castle", 1);
  ASSERT_TRUE(Complete("castle", 1, 1, Digest('a')).ok());
  ASSERT_TRUE(store().ReopenCameraJob("castle", 1, 1, "", "no surface", kNow + kLease, Conduct("castle")).ok());
  const auto open = store().ListOpenJobs();
  ASSERT_EQ(open->size(), 1);
  EXPECT_FALSE(open->at(0).is_repair);
  EXPECT_EQ(open->at(0).failed_attempts, 1);
  EXPECT_EQ(open->at(0).not_before, kNow + kLease);
  EXPECT_TRUE(store().ListResults("castle")->empty());
  ASSERT_TRUE(Skip("castle", 1, 2, "no surface").ok());
  ASSERT_EQ(store().ListResults("castle")->size(), 1);
  EXPECT_TRUE(store().ListResults("castle")->at(0).skipped);
  EXPECT_TRUE(store().ListResults("castle", 1)->empty());
}

// Two stores as two coordinators have them, several threads each: every job is leased exactly once.
TEST_P(JobStoreConformance, NoJobIsLeasedTwice) {
  constexpr int kJobs = 60;
  constexpr int kThreads = 4;
  AssignJobs("castle", kJobs);
  const std::unique_ptr<JobStore> other = fixture_.reopen();
  std::vector<int> won(kThreads, 0);
  std::vector<std::thread> threads;
  threads.reserve(kThreads);
  for (int t = 0; t < kThreads; ++t) {
    threads.emplace_back([&, t] {
      JobStore& mine = t % 2 == 0 ? store() : *other;
      for (int begin = 1; begin <= kJobs; begin += 6) {
        std::vector<JobChange> claims;
        for (int s = begin; s < begin + 6; ++s) {
          claims.push_back(ChangeOf(JobChange::Kind::kClaim, s, 1, "worker" + std::to_string(t)));
        }
        const auto results = mine.ApplyChanges(claims, {}, kNow);
        if (!results.ok()) continue;
        for (const JobChangeResult& result : *results) won[static_cast<size_t>(t)] += result.status.ok() ? 1 : 0;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(won[0] + won[1] + won[2] + won[3], kJobs);
  const auto jobs = store().ListCameraJobs("castle");
  for (const CameraJob& job : *jobs) EXPECT_EQ(job.epoch, 2);
}

// Conductors.

TEST_P(JobStoreConformance, AReconstructionHasOneConductorAtATime) {
  ASSERT_EQ(store().ListConducted()->size(), 1);
  EXPECT_EQ(store().ListConducted()->at(0).lease.epoch, 0);
  EXPECT_TRUE(absl::IsNotFound(store().GetConductorLease("castle").status()));
  const auto first = store().AcquireConductorLease("castle", "north", kNow + kLease, kNow);
  ASSERT_TRUE(first.ok()) << first.status();
  EXPECT_EQ(*first, 1);
  EXPECT_EQ(store().ListConducted()->at(0).lease.owner, "north");
  const absl::Status refused = store().AcquireConductorLease("castle", "south", kNow + kLease, kNow).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(refused)) << refused;
  EXPECT_TRUE(store().RenewConductorLease("castle", 1, kNow + 2 * kLease, kNow).ok());
  EXPECT_FALSE(store().AcquireConductorLease("castle", "south", kNow + 3 * kLease, kNow + kLease).ok());
  Reopen();
  EXPECT_EQ(store().GetConductorLease("castle")->owner, "north");
  EXPECT_EQ(store().GetConductorLease("castle")->expires_at, kNow + 2 * kLease);
  EXPECT_EQ(*store().AcquireConductorLease("castle", "south", kNow + 9 * kLease, kNow + 2 * kLease), 2);
  EXPECT_TRUE(absl::IsAborted(store().RenewConductorLease("castle", 1, kNow + 9 * kLease, kNow)));
  // Released: the next one need not wait. A release of an old epoch changes nothing.
  EXPECT_TRUE(store().ReleaseConductorLease("castle", 1, kNow).ok());
  EXPECT_EQ(store().ListConducted()->at(0).lease.expires_at, kNow + 9 * kLease);
  EXPECT_TRUE(store().ReleaseConductorLease("castle", 2, kNow + 3 * kLease).ok());
  EXPECT_EQ(*store().AcquireConductorLease("castle", "north", kNow + 9 * kLease, kNow + 3 * kLease), 3);
  // A coordinator that was restarted under its name takes back what it held.
  EXPECT_EQ(*store().AcquireConductorLease("castle", "north", kNow + 9 * kLease, kNow + 3 * kLease), 4);
  EXPECT_TRUE(absl::IsNotFound(store().AcquireConductorLease("ruin", "north", kNow + kLease, kNow).status()));
  EXPECT_TRUE(absl::IsAborted(store().RenewConductorLease("ruin", 1, kNow + kLease, kNow)));
}

TEST_P(JobStoreConformance, OnlyTheConductorWrites) {
  ASSERT_EQ(*store().AcquireConductorLease("castle", "north", kNow + kLease, kNow), 1);
  const auto advance = [&](const std::vector<Commit>& commits, const std::vector<CameraAssignment>& chosen,
                           int64_t epoch) { return store().Advance("castle", commits, chosen, {}, kNow, epoch); };
  ASSERT_TRUE(advance({}, {{1, 7, 0}}, 1).ok());
  ASSERT_TRUE(Complete(1, 1, Digest('a')).ok());
  ASSERT_EQ(*store().AcquireConductorLease("castle", "south", kNow + 3 * kLease, kNow + 2 * kLease), 2);
  const Commit commit = {1, 7, Digest('b'), 9, 4};
  const auto finish = [&](int64_t epoch) {
    return store().SetReconstructionState("castle", ReconstructionState::kDone, "", kNow, epoch);
  };
  for (const int64_t epoch : {0, 1, 3}) {
    EXPECT_TRUE(absl::IsAborted(advance({commit}, {}, epoch)));
    EXPECT_TRUE(absl::IsAborted(advance({}, {{2, 8, 0}}, epoch)));
    EXPECT_TRUE(absl::IsAborted(advance({}, {{1, 7, 0}}, epoch)));
    EXPECT_TRUE(absl::IsAborted(advance({}, {}, epoch)));
    EXPECT_TRUE(absl::IsAborted(finish(epoch)));
    EXPECT_TRUE(absl::IsAborted(store().FinishReconstruction("castle", {Digest('m'), 5, 6, 7}, kNow, epoch)));
    EXPECT_TRUE(absl::IsAborted(store().ReopenCameraJob("castle", 1, 1, "", "none", kNow, epoch)));
  }
  EXPECT_TRUE(store().ListCommits("castle")->empty());
  EXPECT_EQ(store().ListCameraJobs("castle")->size(), 1);
  EXPECT_TRUE(advance({commit}, {}, 2).ok());
  EXPECT_TRUE(advance({commit}, {}, 2).ok());
  EXPECT_TRUE(advance({}, {{2, 8, 0}}, 2).ok());
  EXPECT_TRUE(finish(2).ok());
  EXPECT_TRUE(store().ListConducted()->empty());
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
  Progress progress = {.cameras_total = 9, .cameras_in_flight = 2};
  ASSERT_TRUE(store().Advance("castle", {}, {{1, 7, 0, 5}, {2, 3, 0, 6}}, progress, kNow, 1).ok());
  ASSERT_TRUE(store().Advance("castle", {}, {}, progress, kNow, 1).ok());
  for (int s = 1; s <= 2; ++s) {
    ASSERT_TRUE(Complete("castle", s, 1, Digest('a')).ok());
  }
  const std::vector<Commit> commits = {{1, 7, Digest('b'), 9, 4}, {2, 3, "", 0, 0}};
  const std::vector<CameraAssignment> choices = {{3, 5, 2, 0}};
  EXPECT_EQ(store().GetReconstruction("castle")->progress, progress);
  progress.cameras_committed = 2;
  progress.joined_thousandths = 431;
  progress.expected_end = kNow + absl::Minutes(3);
  EXPECT_TRUE(absl::IsAborted(store().Advance("castle", commits, choices, progress, kNow, 2)));
  EXPECT_TRUE(absl::IsFailedPrecondition(store().Advance("castle", {commits[1]}, choices, progress, kNow, 1)));
  EXPECT_TRUE(store().ListCommits("castle")->empty());
  EXPECT_EQ(store().ListCameraJobs("castle")->size(), 2);
  EXPECT_TRUE(store().Advance("castle", commits, choices, progress, kNow, 1).ok());
  EXPECT_TRUE(store().Advance("castle", commits, choices, progress, kNow, 1).ok());
  // A part of it is there already.
  EXPECT_TRUE(store().Advance("castle", {commits[1]}, {{3, 5, 2, 0}, {4, 6, 2, 0}}, progress, kNow, 1).ok());
  Reopen();
  EXPECT_THAT(*store().ListCommits("castle"), testing::ElementsAreArray(commits));
  EXPECT_EQ(store().ListCameraJobs("castle")->size(), 4);
  EXPECT_EQ(store().GetCameraJob("castle", 1)->memory_bytes, 5);
  EXPECT_EQ(store().GetReconstruction("castle")->progress, progress);
}

// More in both directions than a connection holds back: who only sends, or only reads, waits forever.
TEST_P(JobStoreConformance, LargeTransactionsGoThrough) {
  constexpr int kJobs = 300;
  std::vector<CameraAssignment> choices;
  std::vector<JobChange> claims;
  for (int s = 1; s <= kJobs; ++s) {
    choices.push_back({.sequence = s, .camera = s, .spec = std::string(20'000, static_cast<char>('a' + s % 26))});
    claims.push_back(ChangeOf(JobChange::Kind::kClaim, s, 1, std::string(20'000, 'w')));
  }
  ASSERT_TRUE(store().Advance("castle", {}, choices, {}, kNow, Conduct("castle")).ok());
  const auto results = store().ApplyChanges(claims, {}, kNow);
  ASSERT_TRUE(results.ok()) << results.status();
  ASSERT_EQ(results->size(), kJobs);
  for (int s = 1; s <= kJobs; ++s) {
    const JobChangeResult& result = (*results)[static_cast<size_t>(s) - 1];
    ASSERT_TRUE(result.status.ok()) << result.status;
    EXPECT_EQ(result.job->sequence, s);
    EXPECT_EQ(result.job->spec, choices[static_cast<size_t>(s) - 1].spec);
  }
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
  EXPECT_TRUE(absl::IsFailedPrecondition(SetState("abbey", ReconstructionState::kRunning)));
  EXPECT_TRUE(SetScene("abbey", Digest('1')).ok());
  EXPECT_TRUE(SetScene("abbey", Digest('2')).ok());
  EXPECT_TRUE(SetState("abbey", ReconstructionState::kRunning).ok());
  EXPECT_TRUE(SetScene("abbey", Digest('2')).ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(SetScene("abbey", Digest('3'))));
  EXPECT_EQ(store().GetReconstruction("abbey")->scene_digest, Digest('2'));
}

TEST_P(JobStoreConformance, FinalStatesStay) {
  ASSERT_TRUE(SetState("castle", ReconstructionState::kFailed, "no pair is feasible").ok());
  EXPECT_TRUE(SetState("castle", ReconstructionState::kFailed, "again").ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(SetState("castle", ReconstructionState::kRunning)));
  EXPECT_TRUE(absl::IsFailedPrecondition(SetState("castle", ReconstructionState::kDone)));
  EXPECT_EQ(store().GetReconstruction("castle")->state, ReconstructionState::kFailed);
  EXPECT_EQ(store().GetReconstruction("castle")->state_reason, "no pair is feasible");
}

TEST_P(JobStoreConformance, DeletingTakesEverythingAlong) {
  AssignJobs("castle", 2);
  ASSERT_TRUE(Claim(1, 1, "ant").status.ok());
  ASSERT_TRUE(Skip("castle", 1, 2, "gone").ok());
  ASSERT_TRUE(AddCommit("castle", {1, 1, "", 0, 0}).ok());
  ASSERT_TRUE(store().AcquireConductorLease("castle", "north", kNow + kLease, kNow).ok());
  EXPECT_TRUE(store().DeleteReconstruction("castle").ok());
  EXPECT_TRUE(store().DeleteReconstruction("castle").ok());
  EXPECT_TRUE(store().ListReconstructions()->empty());
  EXPECT_TRUE(absl::IsAlreadyExists(store().CreateReconstruction(kReconstruction, kNow)));  // its id stays taken
  EXPECT_TRUE(store().ListAttempts("castle", 10)->empty());
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
    ASSERT_TRUE(Skip("castle", s, 1, "gone").ok());
    ASSERT_TRUE(AddCommit("castle", {s, s, "", 0, 0}).ok());
  }
  EXPECT_THAT(*store().ListCommits("castle", 2), testing::ElementsAre(Commit{3, 3, "", 0, 0}));
  ASSERT_EQ(store().ListCommits("castle")->size(), 3U);
  EXPECT_THAT(*store().ListCommits("castle", 1, 1), testing::ElementsAre(store().ListCommits("castle")->at(1)));
}

TEST_P(JobStoreConformance, TextIsKeptAsItIs) {
  const std::string odd = "'; DROP TABLE reconstructions; -- \\ $1 :id % \xc3\xa9\n";
  ASSERT_TRUE(store().CreateReconstruction({odd, "{ \"b\" : 1,\n \"a\":2}", Digest('1')}, kNow).ok());
  const auto stored = store().GetReconstruction(odd);
  ASSERT_TRUE(stored.ok()) << stored.status();
  EXPECT_EQ(stored->id, odd);
  EXPECT_EQ(stored->options_json, "{ \"b\" : 1,\n \"a\":2}");
  AssignJobs(odd, 1);
  ASSERT_TRUE(Skip(odd, 1, 1, std::string("a\0b\xe2\x82", 5)).ok());
  EXPECT_EQ(store().GetCameraJob(odd, 1)->skip_reason, "a?b??");
}

// Workers.

TEST_P(JobStoreConformance, WorkersAreKnownByTheirHeartbeats) {
  EXPECT_TRUE(absl::IsNotFound(store().SetWorkerDrained("ant", true)));
  const WorkerRecord bee = {.id = "bee", .cores = 4, .memory_bytes = 8'000'000'000, .last_heartbeat = kNow};
  WorkerRecord ant = {.id = "ant", .cores = 2, .memory_bytes = 1'000, .last_heartbeat = kNow};
  ASSERT_TRUE(store().ApplyChanges({}, {bee, ant}, kNow).ok());
  ASSERT_TRUE(store().SetWorkerDrained("ant", true).ok());
  // It was drained as one process and comes as another one, which is drained in turn.
  ant.instance = "x";
  ASSERT_TRUE(store().ApplyChanges({}, {ant}, kNow).ok());
  EXPECT_FALSE(store().ListWorkers()->at(0).drained);
  ASSERT_TRUE(store().SetWorkerDrained("ant", true).ok());
  ant = {.id = "ant",
         .cores = 3,
         .memory_bytes = 2'000,
         .last_heartbeat = kNow + kLease,
         .instance = "x",
         .version = "7",
         .draining = true,
         .method_version = 3,
         .colmap_version = "3.8",
         .owner = "user hive"};
  ASSERT_TRUE(store().ApplyChanges({}, {ant}, kNow).ok());
  Reopen();
  const auto workers = store().ListWorkers();
  ASSERT_TRUE(workers.ok());
  ASSERT_EQ(workers->size(), 2);
  EXPECT_EQ(workers->at(0).id, "ant");
  EXPECT_EQ(workers->at(0).cores, 3);
  EXPECT_EQ(workers->at(0).memory_bytes, 2'000);
  EXPECT_EQ(workers->at(0).last_heartbeat, kNow + kLease);
  EXPECT_EQ(workers->at(0).instance, "x");
  EXPECT_EQ(workers->at(0).version, "7");
  EXPECT_EQ(workers->at(0).method_version, 3);
  EXPECT_EQ(workers->at(1).method_version, 0);
  EXPECT_EQ(workers->at(0).colmap_version, "3.8");
  EXPECT_EQ(workers->at(0).owner, "user hive");
  EXPECT_TRUE(workers->at(0).drained);
  EXPECT_TRUE(workers->at(0).draining);
  EXPECT_EQ(workers->at(1).memory_bytes, 8'000'000'000);
  EXPECT_FALSE(workers->at(1).drained);
}

TEST_P(JobStoreConformance, SilentWorkersAreForgottenUnlessTheyHoldSomething) {
  AssignJobs("castle", 1);
  ASSERT_TRUE(Claim(1, 1, "ant").status.ok());
  for (const char* id : {"ant", "bee", "cat"}) {
    const absl::Time heard = id == std::string("cat") ? kNow + kLease : kNow;
    ASSERT_TRUE(store().ApplyChanges({}, {{.id = id, .cores = 1, .last_heartbeat = heard}}, kNow).ok());
  }
  ASSERT_TRUE(store().RemoveSilentWorkers(kNow + kLease).ok());
  ASSERT_EQ(store().ListWorkers()->size(), 2);
  EXPECT_EQ(store().ListWorkers()->at(1).id, "cat");
}

// Files and blobs.

TEST_P(JobStoreConformance, SceneFilesAreReplacedByPath) {
  ASSERT_TRUE(store().PutSceneFile("castle", {"b/c.jpg", 5, Digest('1')}).ok());
  ASSERT_TRUE(store().PutSceneFile("castle", {"a.txt", 6, Digest('2')}).ok());
  ASSERT_TRUE(store().PutSceneFile("castle", {"a.txt", 7, Digest('3')}).ok());
  EXPECT_FALSE(store().PutSceneFile("ruin", {"a.txt", 7, Digest('3')}).ok());
  EXPECT_THAT(*store().ListSceneFiles("castle"),
              testing::ElementsAre(SceneFile{"a.txt", 7, Digest('3')}, SceneFile{"b/c.jpg", 5, Digest('1')}));
}

TEST_P(JobStoreConformance, OnlyBlobsThatNobodyElseHasVanish) {
  ASSERT_TRUE(store().CreateReconstruction({"abbey", "{}", Digest('1')}, kNow).ok());
  AssignJobs("castle", 2);
  AssignJobs("abbey", 2);
  EXPECT_TRUE(*store().AddBlobRef("castle", Digest('p')));
  EXPECT_TRUE(*store().AddBlobRef("castle", Digest('p')));
  EXPECT_TRUE(*store().AddBlobRef("castle", Digest('q')));
  EXPECT_TRUE(*store().AddBlobRef("abbey", Digest('q')));
  EXPECT_TRUE(absl::IsNotFound(store().AddBlobRef("ruin", Digest('q')).status()));
  ASSERT_TRUE(Complete("castle", 1, 1, Digest('a')).ok());
  ASSERT_TRUE(Complete("castle", 2, 1, Digest('b')).ok());
  ASSERT_TRUE(Complete("abbey", 1, 1, Digest('b')).ok());
  ASSERT_TRUE(AddCommit("castle", {1, 1, Digest('c'), 9, 4}).ok());
  ASSERT_TRUE(AddCommit("castle", {2, 2, Digest('d'), 9, 4}).ok());
  ASSERT_TRUE(AddCommit("abbey", {1, 1, Digest('d'), 9, 4}).ok());
  ASSERT_TRUE(store().BeginDeletion("castle").ok());
  EXPECT_TRUE(store().BeginDeletion("castle").ok());
  EXPECT_EQ(store().ListReconstructions()->size(), 1);
  EXPECT_THAT(*store().MarkBlobsForDeletion("castle"), testing::ElementsAre(Digest('a'), Digest('c'), Digest('p')));
  // Nobody may put one of them now; once they are gone they may come back.
  EXPECT_FALSE(*store().AddBlobRef("abbey", Digest('p')));
  EXPECT_THAT(*store().MarkBlobsForDeletion("castle"), testing::ElementsAre(Digest('a'), Digest('c')));
  ASSERT_TRUE(store().DeleteReconstruction("castle").ok());
  EXPECT_TRUE(*store().AddBlobRef("abbey", Digest('p')));
  // The other one takes the rest along.
  ASSERT_TRUE(store().BeginDeletion("abbey").ok());
  EXPECT_THAT(*store().MarkBlobsForDeletion("abbey"),
              testing::ElementsAre(Digest('b'), Digest('d'), Digest('p'), Digest('q')));
}

TEST_P(JobStoreConformance, DamagedBlobsAreReportedOnce) {
  EXPECT_TRUE(store().ReportDamagedBlob("castle", Digest('a')).ok());
  EXPECT_TRUE(store().ReportDamagedBlob("castle", Digest('a')).ok());
  EXPECT_THAT(*store().ListDamagedBlobs("castle"), testing::ElementsAre(Digest('a')));
  EXPECT_TRUE(store().ForgetDamagedBlob("castle", Digest('a')).ok());
  EXPECT_TRUE(store().ListDamagedBlobs("castle")->empty());
}

TEST_P(JobStoreConformance, AMeshEndsAReconstruction) {
  ASSERT_TRUE(SetState("castle", ReconstructionState::kJoining).ok());
  EXPECT_EQ(store().GetReconstruction("castle")->finished_at, absl::InfinitePast());
  const StoredMesh mesh = {Digest('m'), 5, 6, 7, R"({"coverage": 0.9})"};
  ASSERT_TRUE(store().FinishReconstruction("castle", mesh, kNow + kLease, Conduct("castle")).ok());
  EXPECT_TRUE(store().FinishReconstruction("castle", mesh, kNow + kLease, Conduct("castle")).ok());
  const Reconstruction done = *store().GetReconstruction("castle");
  EXPECT_EQ(done.state, ReconstructionState::kDone);
  EXPECT_EQ(done.finished_at, kNow + kLease);
  EXPECT_EQ(done.created_at, kNow);
  EXPECT_EQ(done.mesh.digest, Digest('m'));
  EXPECT_EQ(done.mesh.faces, 7);
  EXPECT_EQ(done.mesh.verdict_json, mesh.verdict_json);
  EXPECT_TRUE(absl::IsFailedPrecondition(store().RequestState("castle", ReconstructionState::kCancelled, kNow)));
}

}  // namespace meshwright
