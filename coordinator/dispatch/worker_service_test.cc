// SPDX-License-Identifier: Apache-2.0
#include "coordinator/dispatch/worker_service.h"

#include <cstdlib>
#include <filesystem>
#include <future>
#include <mutex>

#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/base/check.h"
#include "common/base/clock.h"
#include "common/base/method_version.h"
#include "common/job/job_spec_codec.h"
#include "coordinator/store/sqlite_job_store.h"

namespace meshwright {
namespace {

using testing::HasSubstr;

v1::SynchronizeRequest Request(const std::string& worker) {
  v1::SynchronizeRequest request;
  request.set_worker_id(worker);
  request.set_instance("1");
  request.set_cores(1);
  request.set_memory_bytes(1000);
  request.set_method_version(kMethodVersion);
  return request;
}

v1::HeldJob Held(const v1::CameraJob& job) {
  v1::HeldJob held;
  *held.mutable_key() = job.key();
  held.mutable_running();
  return held;
}

// Two coordinators over one store.
class WorkerServiceTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = testing::TempDir() + "worker_logic_XXXXXX";
    MW_CHECK(mkdtemp(pattern.data()) != nullptr);
    folder_ = pattern;
    store_ = *OpenSqliteJobStore(folder_ + "/state.sqlite", &clock_);
    ASSERT_TRUE(
        store_->CreateReconstruction({.id = "a", .options_json = "{}", .scene_digest = kDigest}, clock_.Now()).ok());
    epoch_ = *store_->AcquireConductorLease("a", "c", clock_.Now() + absl::Seconds(5), clock_.Now());
    service_ =
        std::make_unique<WorkerService>(kLease, RetryOptions{.backoff = absl::ZeroDuration()}, *store_, monotonic_);
    other_ =
        std::make_unique<WorkerService>(kLease, RetryOptions{.backoff = absl::ZeroDuration()}, *store_, monotonic_);
  }
  void TearDown() override {
    service_.reset();
    other_.reset();
    store_.reset();
    std::filesystem::remove_all(folder_);
  }
  void Offer(SequenceNumber sequence, int64_t memory_bytes = 10) {
    StoredJobSpec spec = {.targets = {2}, .memory_bytes = {memory_bytes, 5}};
    spec.accepted.push_back({.sequence = 1, .camera = 1, .digest = "d", .patches = 5});
    const CameraAssignment assignment = {.sequence = sequence,
                                         .camera = 6 + sequence,
                                         .memory_bytes = memory_bytes,
                                         .neighbours = {1, 2},
                                         .spec = EncodeJobSpec(spec)};
    const absl::Status assigned = store_->Advance("a", {}, {assignment}, {}, clock_.Now(), epoch_);
    ASSERT_TRUE(assigned.ok()) << assigned;
  }
  static v1::SynchronizeResponse Synchronize(WorkerService& service, const v1::SynchronizeRequest& request) {
    auto response = service.Synchronize(request, [] { return false; });
    EXPECT_TRUE(response.ok()) << response.status();
    return response.ok() ? *response : v1::SynchronizeResponse();
  }
  v1::SynchronizeResponse Synchronize(const v1::SynchronizeRequest& request) { return Synchronize(*service_, request); }
  std::string Refused(const v1::SynchronizeRequest& request) {
    const auto response = service_->Synchronize(request, [] { return false; });
    EXPECT_TRUE(absl::IsInvalidArgument(response.status())) << response.status();
    return std::string(response.status().message());
  }
  v1::SynchronizeRequest FinishedRequest(const std::string& worker, const v1::CameraJob& job,
                                         const std::string& digest) const {
    v1::SynchronizeRequest request = Request(worker);
    *request.add_held() = Held(job);
    request.mutable_held(0)->mutable_finished()->set_filtered_digest(digest);
    request.mutable_held(0)->mutable_finished()->set_report_json("{}");
    request.mutable_held(0)->mutable_finished()->add_weak_targets(2);
    return request;
  }
  // Time goes by in small steps, so that nobody takes it for a pause of the coordinator.
  void Pass(absl::Duration duration) {
    for (const absl::Time end = clock_.Now() + duration; clock_.Now() < end;) {
      clock_.Advance(absl::Seconds(5));
      monotonic_.Advance(absl::Seconds(5));
      v1::SynchronizeRequest onlooker = Request("onlooker");
      onlooker.set_draining(true);
      Synchronize(onlooker);
    }
  }
  CameraJob Stored(SequenceNumber sequence) { return *store_->GetCameraJob("a", sequence); }

  static inline const std::string kDigest = std::string(64, 'e');
  static inline const LeaseOptions kLease = {.lease = absl::Seconds(30), .job_time_limit = absl::Hours(1)};
  std::string folder_;
  ManualClock clock_;      // the store's
  ManualClock monotonic_;  // the coordinators'
  std::unique_ptr<JobStore> store_;
  int64_t epoch_ = 0;  // of the lease of the reconstruction's conductor
  std::unique_ptr<WorkerService> service_;
  std::unique_ptr<WorkerService> other_;
};

// The store's clock is set an hour forward or back: who is heard keeps its job, who is silent loses it after its lease.
TEST_F(WorkerServiceTest, AClockThatIsSetDecidesNothing) {
  SequenceNumber sequence = 0;
  for (const absl::Duration jump : {absl::Hours(1), absl::Hours(-1), absl::Hours(5), absl::Hours(-9)}) {
    Offer(++sequence);
    const v1::SynchronizeResponse first = Synchronize(Request("w"));
    ASSERT_EQ(first.jobs_size(), 1);
    v1::SynchronizeRequest running = Request("w");
    *running.add_held() = Held(first.jobs(0));
    clock_.Advance(jump);
    for (int i = 0; i < 10; ++i) {
      Pass(absl::Seconds(5));
      ASSERT_EQ(Synchronize(running).jobs_size(), 1) << jump << " " << i;
    }
    EXPECT_EQ(Stored(sequence).losses, 0) << jump;
    EXPECT_GE(service_->ListWorkers().workers_size(), 2) << jump;
    clock_.Advance(jump);
    Pass(absl::Seconds(20));
    EXPECT_EQ(Stored(sequence).lease_worker, "w") << jump;
    Pass(absl::Seconds(20));
    EXPECT_EQ(Stored(sequence).lease_worker, "") << jump;
    EXPECT_EQ(Stored(sequence).losses, 1) << jump;
    // A backoff that was begun before a jump does not last for hours.
    clock_.Advance(-absl::AbsDuration(jump));
    const v1::SynchronizeResponse again = Synchronize(Request("v"));
    ASSERT_EQ(again.jobs_size(), 1) << jump;
    Synchronize(FinishedRequest("v", again.jobs(0), kDigest));
  }
}

// A rolling upgrade and back: workers of both versions are connected, and each does what was begun with its own.
TEST_F(WorkerServiceTest, WorkersOfOtherMethodsGetNothingAndCostNoCamera) {
  Offer(1);
  v1::SynchronizeRequest next = Request("next");
  next.set_method_version(kMethodVersion + 1);
  v1::SynchronizeRequest silent = Request("silent");
  silent.clear_method_version();
  for (int call = 0; call < 20; ++call) {
    EXPECT_EQ(Synchronize(next).jobs_size(), 0);
    EXPECT_EQ(Synchronize(silent).jobs_size(), 0);
  }
  ASSERT_EQ(service_->WarningsFor("a").size(), 1);
  EXPECT_THAT(service_->WarningsFor("a")[0], HasSubstr(absl::StrCat("version ", kMethodVersion, " of the method")));
  EXPECT_THAT(service_->WarningsFor("a")[0], HasSubstr(absl::StrCat("none told, ", kMethodVersion + 1)));
  EXPECT_EQ(Stored(1).failed_attempts, 0);
  EXPECT_EQ(Stored(1).losses, 0);
  EXPECT_EQ(Synchronize(Request("w")).jobs_size(), 1);
  EXPECT_TRUE(service_->WarningsFor("a").empty());
}

TEST_F(WorkerServiceTest, AJobIsToldAgainUntilItsResultIsThere) {
  Offer(1);
  const v1::SynchronizeResponse first = Synchronize(Request("w"));
  ASSERT_EQ(first.jobs_size(), 1);
  EXPECT_EQ(first.jobs(0).camera(), 7);
  EXPECT_EQ(first.jobs(0).accepted(0).digest(), "d");
  EXPECT_EQ(first.jobs(0).targets(0), 2);
  EXPECT_EQ(first.jobs(0).options_json(), "{}");
  // The answer was lost: the same again, also from another coordinator.
  EXPECT_EQ(Synchronize(Request("w")).SerializeAsString(), first.SerializeAsString());
  EXPECT_EQ(Synchronize(*other_, Request("w")).SerializeAsString(), first.SerializeAsString());

  v1::SynchronizeRequest running = Request("w");
  *running.add_held() = Held(first.jobs(0));
  const v1::SynchronizeResponse known = Synchronize(running);
  ASSERT_EQ(known.jobs_size(), 1);
  EXPECT_EQ(known.jobs(0).key().SerializeAsString(), first.jobs(0).key().SerializeAsString());

  // Its result may go to any coordinator, and twice.
  const v1::SynchronizeRequest finished = FinishedRequest("w", first.jobs(0), kDigest);
  EXPECT_EQ(Synchronize(*other_, finished).jobs_size(), 0);
  EXPECT_EQ(Stored(1).state, CameraJobState::kDone);
  EXPECT_EQ(Stored(1).filtered_digest, kDigest);
  EXPECT_THAT(Stored(1).weak_targets, testing::ElementsAre(2));
  EXPECT_EQ(Synchronize(finished).jobs_size(), 0);
  EXPECT_EQ(Synchronize(FinishedRequest("w", first.jobs(0), std::string(64, 'f'))).jobs_size(), 0);
  EXPECT_EQ(Stored(1).filtered_digest, kDigest);
  EXPECT_EQ(store_->ListAttempts("a", 10)->size(), 1);
}

TEST_F(WorkerServiceTest, TheResultOfALostLeaseIsNotTaken) {
  Offer(1);
  const v1::SynchronizeResponse first = Synchronize(Request("slow"));
  Pass(absl::Seconds(40));
  EXPECT_EQ(Stored(1).losses, 1);
  EXPECT_EQ(Synchronize(*other_, Request("quick")).jobs(0).key().epoch(), 3);
  EXPECT_EQ(Synchronize(FinishedRequest("slow", first.jobs(0), kDigest)).jobs_size(), 0);
  EXPECT_EQ(Stored(1).state, CameraJobState::kAssigned);
  EXPECT_EQ(Stored(1).lease_worker, "quick");
}

TEST_F(WorkerServiceTest, WhoIsHeardKeepsItsJob) {
  Offer(1);
  v1::SynchronizeRequest running = Request("w");
  *running.add_held() = Held(Synchronize(running).jobs(0));
  for (int i = 0; i < 10; ++i) {
    Pass(absl::Seconds(10));
    EXPECT_EQ(Synchronize(i % 2 == 0 ? *service_ : *other_, running).jobs_size(), 1);
  }
  EXPECT_EQ(Stored(1).losses, 0);
}

TEST_F(WorkerServiceTest, WhatFailsThreeTimesIsSkipped) {
  Offer(1);
  std::vector<std::string> told;
  std::mutex mutex;
  service_->SetListener([&](const std::string& id) {
    const std::lock_guard<std::mutex> lock(mutex);
    told.push_back(id);
  });
  v1::SynchronizeRequest request = Request("w");
  for (int i = 1; i <= 3; ++i) {
    const v1::SynchronizeResponse response = Synchronize(Request("w"));
    ASSERT_EQ(response.jobs_size(), 1) << i;
    request.clear_held();
    *request.add_held() = Held(response.jobs(0));
    request.mutable_held(0)->mutable_failed()->set_reason(absl::StrCat("broken ", i));
    request.set_draining(true);  // or it would get the job again at once
    Synchronize(request);
  }
  EXPECT_EQ(Stored(1).state, CameraJobState::kSkipped);
  EXPECT_EQ(Stored(1).skip_reason, "broken 3");
  EXPECT_EQ(store_->ListAttempts("a", 10)->size(), 3);
  const std::lock_guard<std::mutex> lock(mutex);
  EXPECT_THAT(told, testing::ElementsAre("a"));
}

TEST_F(WorkerServiceTest, ACancelledReconstructionsJobsAreTakenAway) {
  Offer(1);
  v1::SynchronizeRequest request = Request("w");
  *request.add_held() = Held(Synchronize(request).jobs(0));
  ASSERT_TRUE(store_->RequestState("a", ReconstructionState::kCancelled, clock_.Now()).ok());
  EXPECT_EQ(Synchronize(request).jobs_size(), 0);
  EXPECT_EQ(service_->ListWorkers().workers_size(), 1);
  EXPECT_EQ(service_->LeasesIn("a"), 0);
}

TEST_F(WorkerServiceTest, WhoWaitsIsToldOfNewWorkFromWhereverItComes) {
  for (WorkerService* const waker : {service_.get(), static_cast<WorkerService*>(nullptr)}) {
    v1::SynchronizeRequest request = Request(waker == nullptr ? "v" : "w");
    request.set_wait_timeout_seconds(20);
    std::promise<v1::SynchronizeResponse> promise;
    service_->Synchronize(request, [&](absl::StatusOr<v1::SynchronizeResponse> answer) {
      promise.set_value(answer.ok() ? *answer : v1::SynchronizeResponse());
    });
    Offer(waker == nullptr ? 2 : 1);
    if (waker != nullptr) waker->Wake();
    EXPECT_EQ(promise.get_future().get().jobs_size(), 1);
  }
}

TEST_F(WorkerServiceTest, WhoGoesAwayWaitsForNothing) {
  v1::SynchronizeRequest request = Request("w");
  request.set_wait_timeout_seconds(20);
  EXPECT_TRUE(absl::IsCancelled(service_->Synchronize(request, [] { return true; }).status()));
  // A second call of a worker ends the first one.
  std::promise<absl::Status> first;
  service_->Synchronize(request,
                        [&](absl::StatusOr<v1::SynchronizeResponse> answer) { first.set_value(answer.status()); });
  EXPECT_EQ(Synchronize(Request("w")).jobs_size(), 0);
  EXPECT_TRUE(absl::IsAborted(first.get_future().get()));
}

TEST_F(WorkerServiceTest, ADrainedWorkerKeepsWhatItHasAndGetsNothingMore) {
  EXPECT_TRUE(absl::IsNotFound(service_->Drain("w")));
  Offer(1);
  v1::SynchronizeRequest running = Request("w");
  running.set_cores(2);
  *running.add_held() = Held(Synchronize(running).jobs(0));
  ASSERT_TRUE(service_->Drain("w").ok());
  ASSERT_TRUE(service_->Drain("w").ok());
  Offer(2);
  EXPECT_EQ(Synchronize(running).jobs_size(), 1);
  EXPECT_TRUE(service_->ListWorkers().workers(0).draining());
  Pass(absl::Seconds(5));  // the other one looks
  EXPECT_EQ(Synchronize(*other_, running).jobs_size(), 1);
  EXPECT_EQ(Stored(1).lease_worker, "w");
  EXPECT_EQ(Stored(2).lease_worker, "");
  // Its next process is not drained.
  v1::SynchronizeRequest anew = Request("w");
  anew.set_instance("2");
  anew.set_wait_timeout_seconds(5);
  EXPECT_EQ(Synchronize(anew).jobs_size(), 1);
}

TEST_F(WorkerServiceTest, AJobThatFitsNobodyIsSpokenOf) {
  Offer(1, int64_t{5} << 30);
  Synchronize(Request("w"));
  ASSERT_EQ(service_->WarningsFor("a").size(), 1);
  EXPECT_THAT(service_->WarningsFor("a")[0], HasSubstr("camera 7 needs 5.0 GiB"));
  EXPECT_TRUE(service_->WarningsFor("b").empty());
  v1::SynchronizeRequest large = Request("large");
  large.set_memory_bytes(int64_t{6} << 30);
  EXPECT_EQ(Synchronize(large).jobs_size(), 1);
  EXPECT_TRUE(service_->WarningsFor("a").empty());
  EXPECT_EQ(service_->RunningIn("a").size(), 1);
}

TEST_F(WorkerServiceTest, AWorkerThatRanOutOfMemoryGetsItsJobBackSmaller) {
  Offer(1);
  ASSERT_EQ(Synchronize(Request("w")).jobs_size(), 1);
  v1::SynchronizeRequest again = Request("w");
  again.set_instance("2");
  again.set_ran_out_of_memory(true);
  again.set_draining(true);
  EXPECT_EQ(Synchronize(again).jobs_size(), 0);
  again.set_draining(false);
  again.set_ran_out_of_memory(false);
  const v1::SynchronizeResponse smaller = Synchronize(again);
  ASSERT_EQ(smaller.jobs_size(), 1);
  EXPECT_EQ(smaller.jobs(0).reduction(), 1);
  EXPECT_EQ(smaller.jobs(0).memory_bytes(), 5);
  EXPECT_EQ(Stored(1).out_of_memory_failures, 1);
}

TEST_F(WorkerServiceTest, BadRequestsNameTheField) {
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
  request.set_wait_timeout_seconds(1e9);
  EXPECT_THAT(Refused(request), HasSubstr("wait_timeout_seconds"));
}

}  // namespace
}  // namespace meshwright
