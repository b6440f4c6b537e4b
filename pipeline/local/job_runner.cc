#include "pipeline/local/job_runner.h"

#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "common/base/check.h"
#include "common/base/status_macros.h"

namespace meshwright {

struct JobRunner::Shared {
  std::mutex mutex;
  std::condition_variable changed;
  std::deque<CameraJobSpec> queue;  // taken from the conductor and not started, by sequence
  int running = 0;
  int64_t reserved_bytes = 0;
  absl::Status status;
};

JobRunner::JobRunner(const Scene& scene, const CameraJobInputMaker& inputs, const CameraJobOptions& options,
                     const CameraJobFunction& job, Conductor& conductor, BlobStore& blobs, ThreadPool& pool,
                     const JobRunnerSettings& settings)
    : scene_(scene),
      inputs_(inputs),
      options_(options),
      job_(job),
      conductor_(conductor),
      blobs_(blobs),
      pool_(pool),
      settings_(settings) {}

absl::Status JobRunner::Run(const std::function<void(const CameraJobReport&)>& finished) {
  Shared shared;
  std::vector<std::thread> workers;
  for (int i = 1; i < settings_.concurrent_jobs; ++i) {
    workers.emplace_back([&] { Work(shared, finished); });
  }
  Work(shared, finished);
  for (std::thread& worker : workers) worker.join();
  return shared.status;
}

int64_t JobRunner::EstimateBytes(const CameraJobSpec& spec) const {
  // Acceptance comes after the job and needs less: three surfaces.
  return inputs_.EstimateBytes(spec) + EstimateCameraJobBytes(inputs_.camera(spec.camera), options_);
}

void JobRunner::Work(Shared& shared, const std::function<void(const CameraJobReport&)>& finished) {
  std::unique_lock<std::mutex> lock(shared.mutex);
  while (shared.status.ok()) {
    for (CameraJobSpec& spec : conductor_.TakeJobs()) shared.queue.push_back(std::move(spec));
    if (shared.queue.empty() && shared.running == 0) {
      MW_CHECK(conductor_.finished());
      return;
    }
    const bool fits = !shared.queue.empty() &&
                      (shared.running == 0 ||
                       shared.reserved_bytes + EstimateBytes(shared.queue.front()) <= settings_.memory_limit_bytes);
    if (!fits) {
      shared.changed.wait(lock);
      continue;
    }
    const CameraJobSpec spec = std::move(shared.queue.front());
    shared.queue.pop_front();
    const int64_t bytes = EstimateBytes(spec);
    ++shared.running;
    shared.reserved_bytes += bytes;
    lock.unlock();
    shared.changed.notify_one();  // there may be more in the queue
    const absl::StatusOr<CameraJobReport> report = Process(spec);
    lock.lock();
    --shared.running;
    shared.reserved_bytes -= bytes;
    shared.status.Update(report.status());
    if (report.ok()) finished(*report);
    shared.changed.notify_all();
  }
}

absl::StatusOr<CameraJobReport> JobRunner::Process(const CameraJobSpec& spec) {
  MW_ASSIGN_OR_RETURN(const FinishedJob done, RunJob(scene_, spec, inputs_, job_, blobs_, pool_));
  MW_RETURN_IF_ERROR(
      conductor_.Complete(spec.sequence, spec.epoch, done.filtered_digest, done.weak_targets, done.report_json));
  return done.report;
}

}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
