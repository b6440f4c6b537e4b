// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/base/mutex.h"
#include "common/base/thread_pool.h"
#include "common/blob/blob_store.h"
#include "common/scene/scene.h"
#include "coordinator/conductor/conductor_lease.h"
#include "coordinator/conductor/outer_loop.h"
#include "coordinator/scheduling/apply_pass.h"
#include "coordinator/scheduling/scheduling_pass.h"
#include "coordinator/store/job_store.h"
#include "worker/camera_job/camera_job.h"
#include "worker/job_input/camera_job_input.h"
#include "worker/job_input/run_job.h"

namespace meshwright {

struct JobRunnerSettings {
  int concurrent_jobs = 1;         // jobs that may run at the same time, >= 1
  int64_t memory_limit_bytes = 0;  // a second job starts only while the estimates of all that run stay below
};

// Runs a reconstruction's outer loop and its jobs in this process until nothing is left to do. To the store it is one
// worker of a cluster: its threads are given jobs by scheduling passes, with leases and epochs, and what they report
// comes back to the outer loop from the store. Neither the number of jobs at the same time nor the pool's threads have
// any influence on the results.
class JobRunner {
 public:
  // All of it outlives the runner. Errors of `blobs` name the blob (LostBlobNamer).
  struct Parts {
    const Scene& scene;
    const CameraJobInputMaker& inputs;
    const CameraJobFunction& job;
    OuterLoop& loop;
    HeldConductorLease& lease;
    JobStore& store;
    BlobStore& blobs;
    ThreadPool& pool;
  };
  JobRunner(const Parts& parts, const JobRunnerSettings& settings) : parts_(parts), settings_(settings) {}

  // `finished` is called after each job, one call at a time. Ends with the first error of any job; jobs that run then
  // are still finished, and what has not run yet stays this worker's: who runs the same reconstruction next goes on.
  absl::Status Run(const std::function<void(const CameraJobReport&)>& finished);

 private:
  struct QueuedJob {
    JobKey key;
    CameraJobSpec spec;
  };
  enum class Turn { kJob, kLook, kEnd };

  void Work(const std::function<void(const CameraJobReport&)>& finished);
  // Waits until there is a job (`next`), or something to look for in the store as nobody else is busy, or an end.
  Turn WaitForTurn(QueuedJob& next);
  absl::StatusOr<FinishedJob> RunOrFail(const CameraJobSpec& spec);
  void Process(const QueuedJob& job, const std::function<void(const CameraJobReport&)>& finished);
  // One step of the outer loop, and a pass over the jobs that it may have written.
  void Step();
  // Passes until nothing more can be given to this worker.
  void Pass() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::Status PassOnce() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  WorkerReport Report() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // What the pass has given to this worker goes into the queue.
  absl::Status Enqueue(const SchedulingPass& pass, AppliedPass applied) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const Parts parts_;
  const JobRunnerSettings settings_;

  Mutex mutex_;
  ConditionVariable changed_;
  std::map<JobKey, HeldJob> held_ ABSL_GUARDED_BY(mutex_);  // not reported as ended yet
  std::deque<QueuedJob> queue_ ABSL_GUARDED_BY(mutex_);     // given and not started, by sequence
  int busy_ ABSL_GUARDED_BY(mutex_) = 0;                    // threads with a turn
  bool ended_ ABSL_GUARDED_BY(mutex_) = false;
  absl::Status status_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace meshwright
