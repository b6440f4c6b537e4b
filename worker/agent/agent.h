// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <tuple>

#include <absl/time/time.h>

#include "meshwright/v1/worker.pb.h"

#include "common/base/backoff.h"
#include "common/base/clock.h"
#include "common/base/method_version.h"
#include "common/base/mutex.h"
#include "common/base/thread_pool.h"
#include "common/blob/blob_store.h"
#include "common/blob/lost_blob.h"
#include "common/job/camera_refinement.h"
#include "common/scene/scene.h"
#include "common/telemetry/log.h"
#include "worker/agent/camera_estimation.h"
#include "worker/agent/job_contexts.h"
#include "worker/agent/worker_channel.h"

namespace meshwright {

// Looks whether a scene's cameras agree with its photographs. Its pictures are blobs. `progress`: how much is done;
// false: stop, with Cancelled.
using CameraRefiner = std::function<absl::StatusOr<CameraRefinement>(
    const Scene& scene, const std::string& options_json, BlobStore& blobs, ThreadPool& pool,
    const std::function<bool(double done)>& progress)>;

struct AgentOptions {
  std::string worker_id;
  std::string version;  // of the program
  int64_t method_version = kMethodVersion;
  int cores = 1;                             // jobs at the same time, and cores of all of them together
  int64_t memory_bytes = 1 << 30;            // what jobs may take together
  absl::Duration drain = absl::Seconds(30);  // after Drain(), jobs may take so long before they are released
  // A worker that held nothing for so long drains by itself.
  absl::Duration exit_when_idle = absl::InfiniteDuration();
  // The process of this worker before this one was killed since memory ran out.
  bool ran_out_of_memory = false;
  std::string work_folder;    // for estimating cameras
  CameraEstimator estimator;  // of a worker that can
  CameraRefiner refiner;      // of a worker that can
};

// What RunCameraJob is, or something quick in tests.
using AgentJob = std::function<CameraJobResult(const CameraJobInput&, const CameraJobOptions&, ThreadPool&)>;

// A worker: holds what the coordinator says that it should hold, and tells what has become of it. All state is in
// memory; losing it costs the jobs that run, nothing else.
class Agent {
 public:
  // `channel`, `blobs` and `clock` outlive the agent. `log` is told of jobs begun, finished, failed and dropped.
  Agent(const AgentOptions& options, WorkerChannel& channel, BlobStore& blobs, JobConfigParser parse, AgentJob job,
        Logger log, const Clock& clock = SystemClock());
  // Waits for jobs that still run.
  ~Agent();

  // Works until Drain(), or AgentOptions::exit_when_idle, and what follows from it.
  void Run();
  // From another thread: takes no new jobs; Run() returns once all that run are finished or released.
  void Drain();

 private:
  using Key = std::tuple<std::string, int32_t, int64_t>;  // reconstruction, sequence, epoch
  struct Held {
    v1::HeldJob told;      // what the coordinator is told
    absl::Duration begun;  // these and those below by Clock::Uptime()
    bool running = true;
    bool dropped = false;  // nobody wants the result
    std::thread thread;
  };

  void Work(const Key& key, const v1::CameraJob& job);
  v1::HeldJob Process(const v1::CameraJob& job);
  v1::HeldJob ProcessPhotographs(const Key& key, const v1::CameraJob& job);
  v1::HeldJob ProcessRefinement(const Key& key, const v1::CameraJob& job);
  // Tells who waits how far it is; false: the job is to be given up.
  bool TellStep(const Key& key, const std::string& step, double fraction);
  v1::SynchronizeRequest NextRequest();
  void Follow(const v1::SynchronizeResponse& response);
  absl::Duration IdleFor();
  bool Finished();

  const AgentOptions options_;
  const std::string instance_;
  WorkerChannel& channel_;
  LostBlobNamer blobs_;
  const AgentJob job_;
  const Logger log_;
  const Clock& clock_;
  JobContexts contexts_;
  ThreadPool pool_;

  Mutex mutex_;
  ConditionVariable wake_;
  std::map<Key, Held> held_ ABSL_GUARDED_BY(mutex_);
  absl::Duration held_last_ ABSL_GUARDED_BY(mutex_);  // something was held, or the worker began
  bool draining_ ABSL_GUARDED_BY(mutex_) = false;
  absl::Duration drain_until_ ABSL_GUARDED_BY(mutex_) = absl::InfiniteDuration();
  // A worker that cannot reach the blobs leaves the jobs to others for a while.
  Backoff backoff_ ABSL_GUARDED_BY(mutex_);
  absl::Duration backoff_until_ ABSL_GUARDED_BY(mutex_) = -absl::InfiniteDuration();
};

}  // namespace meshwright
