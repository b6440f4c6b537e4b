// SPDX-License-Identifier: Apache-2.0
#include "worker/telemetry/measured_worker_channel.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace meshwright {
namespace {

using testing::HasSubstr;

// Answers what it is told to answer.
class Coordinator : public WorkerChannel {
 public:
  absl::StatusOr<v1::SynchronizeResponse> Synchronize(const v1::SynchronizeRequest&) override { return answer; }
  void Interrupt() override { ++interrupts; }

  absl::StatusOr<v1::SynchronizeResponse> answer = v1::SynchronizeResponse();
  int interrupts = 0;
};

void SetKey(int sequence, v1::JobKey& key) {
  key.set_reconstruction_id("r");
  key.set_sequence(sequence);
  key.set_epoch(1);
}

v1::SynchronizeResponse Jobs(std::initializer_list<int> sequences) {
  v1::SynchronizeResponse response;
  for (const int sequence : sequences) SetKey(sequence, *response.add_jobs()->mutable_key());
  return response;
}

class MeasuredWorkerChannelTest : public testing::Test {
 protected:
  v1::HeldJob& Hold(int sequence) {
    v1::HeldJob& held = *request_.add_held();
    SetKey(sequence, *held.mutable_key());
    return held;
  }
  void Synchronize() { last_ = channel_.Synchronize(request_); }
  void ExpectLine(const std::string& line) { EXPECT_THAT(metrics_.Text(), HasSubstr("\n" + line + "\n")); }

  Metrics metrics_{"worker"};
  ManualClock clock_;
  Coordinator coordinator_;
  MeasuredWorkerChannel channel_{coordinator_, metrics_, clock_};
  v1::SynchronizeRequest request_;
  absl::StatusOr<v1::SynchronizeResponse> last_;
};

TEST_F(MeasuredWorkerChannelTest, AFinishedJobCountsOnceHoweverOftenItIsTold) {
  coordinator_.answer = Jobs({1});
  Synchronize();
  ExpectLine("meshwright_worker_jobs_running 1");
  clock_.Advance(absl::Seconds(3));
  v1::HeldJob::Finished& finished = *Hold(1).mutable_finished();
  finished.set_report_json(
      R"({"rays": 100, "rays_grown": 60, "seeds": 7, "tentative_patches_scored": 4000, "targets": ["a"],
          "seconds": {"seeding": 0.25, "growing": 1.5}})");
  coordinator_.answer = absl::UnavailableError("the answer got lost");
  Synchronize();
  coordinator_.answer = Jobs({});
  Synchronize();
  ExpectLine("meshwright_camera_jobs_total{outcome=\"finished\"} 1");
  ExpectLine("meshwright_camera_job_seconds_count 1");
  ExpectLine("meshwright_camera_job_seconds_sum 3");
  ExpectLine("meshwright_rays_total 100");
  ExpectLine("meshwright_rays_grown_total 60");
  ExpectLine("meshwright_seeds_total 7");
  ExpectLine("meshwright_tentative_patches_scored_total 4000");
  ExpectLine("meshwright_rays_filtered_total 0");
  ExpectLine("meshwright_camera_job_stage_seconds_sum{stage=\"growing\"} 1.5");
  ExpectLine("meshwright_camera_job_stage_seconds_count{stage=\"seeding\"} 1");
  ExpectLine("meshwright_coordinator_call_errors_total{code=\"unavailable\",operation=\"synchronize\"} 1");
  ExpectLine("meshwright_worker_jobs_running 0");
}

TEST_F(MeasuredWorkerChannelTest, OutcomesAreKeptApart) {
  Hold(1).mutable_failed()->set_reason("a photograph cannot be read");
  Hold(2).mutable_failed()->set_infrastructure(true);
  Hold(3).mutable_released();
  Hold(4).mutable_running();
  Hold(5).mutable_running();
  coordinator_.answer = Jobs({5});  // 4 belongs to somebody else now
  Synchronize();
  for (const char* const outcome : {"failed", "failed_infrastructure", "released", "lost"}) {
    ExpectLine(std::string("meshwright_camera_jobs_total{outcome=\"") + outcome + "\"} 1");
  }
  ExpectLine("meshwright_camera_jobs_total{outcome=\"finished\"} 0");
  ExpectLine("meshwright_worker_jobs_running 1");
}

TEST_F(MeasuredWorkerChannelTest, TheSameJobHandedOutAgainCountsAgain) {
  Hold(1).mutable_failed();
  Synchronize();
  request_.clear_held();
  Synchronize();
  Hold(1).mutable_failed();
  Synchronize();
  ExpectLine("meshwright_camera_jobs_total{outcome=\"failed\"} 2");
}

TEST_F(MeasuredWorkerChannelTest, ReportsThatAreNoReportsAreLeftOut) {
  for (const char* const report :
       {"", "[1]", "{\"rays\": \"many\", \"seconds\": 3}", "{\"seconds\": {\"growing\": null}}"}) {
    request_.clear_held();
    Synchronize();
    Hold(1).mutable_finished()->set_report_json(report);
    Synchronize();
  }
  ExpectLine("meshwright_camera_jobs_total{outcome=\"finished\"} 4");
  ExpectLine("meshwright_rays_total 0");
}

TEST_F(MeasuredWorkerChannelTest, IsReadyWhileTheCoordinatorAnswers) {
  EXPECT_TRUE(absl::IsUnavailable(channel_.Ready()));
  Synchronize();
  EXPECT_TRUE(channel_.Ready().ok());
  coordinator_.answer = absl::UnavailableError("gone");
  clock_.Advance(absl::Seconds(30));
  Synchronize();
  EXPECT_TRUE(channel_.Ready().ok());
  clock_.Advance(absl::Seconds(45));
  Synchronize();
  EXPECT_THAT(std::string(channel_.Ready().message()), HasSubstr("75 s"));
}

TEST_F(MeasuredWorkerChannelTest, WhatTheWorkerOffersIsTold) {
  request_.set_cores(4);
  request_.set_memory_bytes(int64_t{1} << 30);
  request_.set_draining(true);
  coordinator_.answer = absl::CancelledError("interrupted");
  Synchronize();
  EXPECT_TRUE(absl::IsCancelled(last_.status()));
  ExpectLine("meshwright_worker_cores 4");
  ExpectLine("meshwright_worker_memory_limit_bytes 1073741824");
  ExpectLine("meshwright_worker_draining 1");
  EXPECT_THAT(metrics_.Text(), testing::Not(HasSubstr("meshwright_coordinator_call_errors_total")));
  channel_.Interrupt();
  EXPECT_EQ(coordinator_.interrupts, 1);
}

}  // namespace
}  // namespace meshwright
