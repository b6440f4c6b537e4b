#include "coordinator/api/worker_logic.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace meshwright {
namespace {

using testing::HasSubstr;

v1::SynchronizeRequest Request(const std::string& worker) {
  v1::SynchronizeRequest request;
  request.set_worker_id(worker);
  request.set_instance("1");
  request.set_cores(1);
  request.set_memory_bytes(1000);
  return request;
}

v1::HeldJob Held(const v1::CameraJob& job) {
  v1::HeldJob held;
  *held.mutable_key() = job.key();
  held.mutable_running();
  return held;
}

class WorkerLogicTest : public testing::Test {
 protected:
  void SetUp() override {
    logic_.AddReconstruction("a", {.options_json = "{}", .scene_digest = "digest", .sink = [this](JobOutcome outcome) {
                                     outcomes_.push_back(std::move(outcome));
                                   }});
  }
  void Offer(SequenceNumber sequence, int64_t epoch) {
    CameraJobSpec spec = {.sequence = sequence, .camera = 7, .epoch = epoch, .neighbours = {1, 2}, .targets = {2}};
    spec.accepted.push_back({.sequence = 1, .camera = 1, .digest = "d", .patches = 5});
    logic_.Offer("a", spec, 10, absl::InfinitePast());
  }
  v1::SynchronizeResponse Synchronize(const v1::SynchronizeRequest& request) {
    auto response = logic_.Synchronize(request, [] { return false; });
    EXPECT_TRUE(response.ok()) << response.status();
    return response.ok() ? *response : v1::SynchronizeResponse();
  }
  std::string Refused(const v1::SynchronizeRequest& request) {
    const auto response = logic_.Synchronize(request, [] { return false; });
    EXPECT_TRUE(absl::IsInvalidArgument(response.status())) << response.status();
    return std::string(response.status().message());
  }

  ManualClock clock_;
  std::vector<JobOutcome> outcomes_;
  WorkerLogic logic_{{.lease = absl::Seconds(30), .job_time_limit = absl::Hours(1)}, clock_};
};

TEST_F(WorkerLogicTest, AJobIsToldAgainUntilItsResultIsThere) {
  Offer(3, 1);
  const v1::SynchronizeResponse first = Synchronize(Request("w"));
  ASSERT_EQ(first.jobs_size(), 1);
  EXPECT_EQ(first.jobs(0).camera(), 7);
  EXPECT_EQ(first.jobs(0).accepted(0).digest(), "d");
  EXPECT_EQ(first.jobs(0).scene_digest(), "digest");
  // The answer was lost: the same again.
  EXPECT_EQ(Synchronize(Request("w")).SerializeAsString(), first.SerializeAsString());

  v1::SynchronizeRequest running = Request("w");
  *running.add_held() = Held(first.jobs(0));
  EXPECT_EQ(Synchronize(running).jobs_size(), 1);
  EXPECT_TRUE(outcomes_.empty());

  v1::SynchronizeRequest finished = running;
  finished.mutable_held(0)->mutable_finished()->set_filtered_digest("f");
  finished.mutable_held(0)->mutable_finished()->add_weak_targets(2);
  EXPECT_EQ(Synchronize(finished).jobs_size(), 0);
  ASSERT_EQ(outcomes_.size(), 1);
  EXPECT_EQ(outcomes_[0].kind, JobOutcome::Kind::kFinished);
  EXPECT_EQ(outcomes_[0].filtered_digest, "f");
  EXPECT_THAT(outcomes_[0].weak_targets, testing::ElementsAre(2));
  // Told twice, counted once.
  EXPECT_EQ(Synchronize(finished).jobs_size(), 0);
  EXPECT_EQ(outcomes_.size(), 1);
}

TEST_F(WorkerLogicTest, TheResultOfALostLeaseIsNotTaken) {
  Offer(3, 1);
  const v1::SynchronizeResponse first = Synchronize(Request("slow"));
  clock_.Advance(absl::Seconds(31));
  logic_.ExpireLeases();
  ASSERT_EQ(outcomes_.size(), 1);
  EXPECT_EQ(outcomes_[0].kind, JobOutcome::Kind::kLost);
  Offer(3, 2);
  EXPECT_EQ(Synchronize(Request("quick")).jobs(0).key().epoch(), 2);

  v1::SynchronizeRequest late = Request("slow");
  *late.add_held() = Held(first.jobs(0));
  late.mutable_held(0)->mutable_finished()->set_filtered_digest("stale");
  EXPECT_EQ(Synchronize(late).jobs_size(), 0);
  EXPECT_EQ(outcomes_.size(), 1);
}

TEST_F(WorkerLogicTest, WhatIsGivenBackOrFailsIsTold) {
  Offer(1, 1);
  v1::SynchronizeRequest request = Request("w");
  *request.add_held() = Held(Synchronize(request).jobs(0));
  request.mutable_held(0)->mutable_given_back();
  request.set_draining(true);
  EXPECT_EQ(Synchronize(request).jobs_size(), 0);
  ASSERT_EQ(outcomes_.size(), 1);
  EXPECT_EQ(outcomes_[0].kind, JobOutcome::Kind::kGivenBack);

  Offer(2, 1);
  v1::SynchronizeRequest other = Request("other");
  *other.add_held() = Held(Synchronize(other).jobs(0));
  other.mutable_held(0)->mutable_failed()->set_reason("broken");
  Synchronize(other);
  ASSERT_EQ(outcomes_.size(), 2);
  EXPECT_EQ(outcomes_[1].kind, JobOutcome::Kind::kFailed);
  EXPECT_EQ(outcomes_[1].reason, "broken");
}

TEST_F(WorkerLogicTest, ACancelledReconstructionsJobsAreTakenAway) {
  Offer(1, 1);
  v1::SynchronizeRequest request = Request("w");
  *request.add_held() = Held(Synchronize(request).jobs(0));
  logic_.RemoveReconstruction("a");
  EXPECT_EQ(Synchronize(request).jobs_size(), 0);
  EXPECT_TRUE(outcomes_.empty());
  EXPECT_EQ(logic_.ListWorkers().workers_size(), 1);
}

TEST_F(WorkerLogicTest, BadRequestsNameTheField) {
  v1::SynchronizeRequest request = Request("");
  EXPECT_THAT(Refused(request), HasSubstr("worker_id"));
  request = Request("w");
  request.set_cores(0);
  EXPECT_THAT(Refused(request), HasSubstr("cores"));
  request = Request("w");
  request.set_memory_bytes(-1);
  EXPECT_THAT(Refused(request), HasSubstr("memory_bytes"));
  request = Request("w");
  request.clear_instance();
  EXPECT_THAT(Refused(request), HasSubstr("instance"));
  request = Request("w");
  request.set_patience_seconds(1e9);
  EXPECT_THAT(Refused(request), HasSubstr("patience_seconds"));
}

}  // namespace
}  // namespace meshwright
