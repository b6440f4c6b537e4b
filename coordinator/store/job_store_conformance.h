#pragma once

#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "coordinator/store/job_store.h"

namespace meshwright {

// What every JobStore must do, run by every backend:
//   INSTANTIATE_TEST_SUITE_P(Sqlite, JobStoreConformance, testing::Values(factory));
// A factory makes a new, empty store that `reopen` can open again, as a restarted process would.
struct JobStoreFixture {
  std::unique_ptr<JobStore> store;
  std::function<std::unique_ptr<JobStore>()> reopen;  // call after store.reset()
};
using JobStoreFactory = std::function<JobStoreFixture()>;

class JobStoreConformance : public testing::TestWithParam<JobStoreFactory> {
 protected:
  void SetUp() override {
    fixture_ = GetParam()();
    ASSERT_TRUE(store().CreateReconstruction(kReconstruction, kNow).ok());
  }

  JobStore& store() { return *fixture_.store; }

  void Reopen() {
    fixture_.store.reset();
    fixture_.store = fixture_.reopen();
    ASSERT_NE(fixture_.store, nullptr);
  }

  static std::string Digest(char letter) { return std::string(64, letter); }

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

}  // namespace meshwright
