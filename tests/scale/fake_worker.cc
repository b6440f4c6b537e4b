// SPDX-License-Identifier: Apache-2.0
#include "tests/scale/fake_worker.h"

#include <optional>

#include <absl/time/clock.h>

#include "common/base/check.h"
#include "common/base/clock.h"
#include "common/base/method_version.h"
#include "common/surface/codec.h"
#include "tests/scale/wall_world.h"

namespace meshwright::scale {

FakeWorkerFigures FakeWorker::Run() {
  FakeWorkerFigures figures;
  const Stopwatch since_begun;
  v1::SynchronizeRequest request;
  request.set_worker_id(id_);
  request.set_instance(id_);
  request.set_cores(1);
  request.set_memory_bytes(int64_t{1} << 30);
  request.set_method_version(kMethodVersion);
  bool is_repeated = false;
  while (!stopping_) {
    const bool brings_result = request.held_size() > 0;
    request.set_wait_timeout_seconds(brings_result ? 0 : 5);
    const Stopwatch since_asked;
    const absl::StatusOr<v1::SynchronizeResponse> answer = channel_.Synchronize(request);
    if (!answer.ok()) {
      if (stopping_) break;
      ++figures.failed_calls;
      is_repeated = true;
      absl::SleepFor(absl::Milliseconds(200));
      continue;  // repeating a call is harmless
    }
    if (brings_result && !is_repeated) figures.answer_seconds.push_back(since_asked.Seconds());
    is_repeated = false;

    // A result that is listed once more has not been taken yet; every other job is a new one.
    std::optional<v1::HeldJob> waiting;
    const v1::CameraJob* next = nullptr;
    for (const v1::CameraJob& job : answer->jobs()) {
      const bool is_held = brings_result && job.key().SerializeAsString() == request.held(0).key().SerializeAsString();
      if (is_held) {
        waiting = request.held(0);
      } else if (next == nullptr) {
        next = &job;
      }
    }
    request.clear_held();
    if (waiting.has_value()) *request.add_held() = *waiting;
    if (next == nullptr) continue;

    const Stopwatch since_started;
    absl::SleepFor(job_);
    const absl::StatusOr<std::string> digest = blobs_.Put(EncodeSurface(WallWorld::FilteredSurface(next->camera())));
    MW_CHECK(digest.ok());
    figures.busy_seconds += since_started.Seconds();
    ++figures.jobs;
    v1::HeldJob* held = request.add_held();
    *held->mutable_key() = next->key();
    held->mutable_finished()->set_filtered_digest(*digest);
    held->mutable_finished()->set_report_json("{}");
  }
  figures.elapsed_seconds = since_begun.Seconds();
  return figures;
}

void FakeWorker::Stop() {
  stopping_ = true;
  channel_.Interrupt();
}

}  // namespace meshwright::scale
