#pragma once

#include <cstdint>
#include <functional>

#include <absl/status/status.h>

#include "common/base/thread_pool.h"
#include "common/blob/blob_store.h"
#include "common/scene/scene.h"
#include "coordinator/conductor/conductor.h"
#include "worker/camera_job/camera_job.h"
#include "worker/job_input/camera_job_input.h"
#include "worker/job_input/run_job.h"

namespace meshwright {

struct JobRunnerSettings {
  int concurrent_jobs = 1;         // jobs that may run at the same time, >= 1
  int64_t memory_limit_bytes = 0;  // a second job starts only while the estimates of all that run stay below
};

// Runs a conductor's jobs in this process until none is left: in-process workers in the place of a cluster's. Neither
// the number of jobs at the same time nor the pool's threads have any influence on the results.
class JobRunner {
 public:
  JobRunner(const Scene& scene, const CameraJobInputMaker& inputs, const CameraJobOptions& options,
            const CameraJobFunction& job, Conductor& conductor, BlobStore& blobs, ThreadPool& pool,
            const JobRunnerSettings& settings);

  // `finished` is called after each job, one call at a time. Ends with the first error of any job; jobs that run then
  // are still finished.
  absl::Status Run(const std::function<void(const CameraJobReport&)>& finished);

 private:
  struct Shared;
  void Work(Shared& shared, const std::function<void(const CameraJobReport&)>& finished);
  absl::StatusOr<CameraJobReport> Process(const CameraJobSpec& spec);
  int64_t EstimateBytes(const CameraJobSpec& spec) const;

  const Scene& scene_;
  const CameraJobInputMaker& inputs_;
  const CameraJobOptions& options_;
  const CameraJobFunction& job_;
  Conductor& conductor_;
  BlobStore& blobs_;
  ThreadPool& pool_;
  const JobRunnerSettings settings_;
};

}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
