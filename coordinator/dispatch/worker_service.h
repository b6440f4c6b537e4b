// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "meshwright/v1/reconstruction.pb.h"
#include "meshwright/v1/worker.pb.h"

#include "common/base/clock.h"
#include "common/base/mutex.h"
#include "coordinator/scheduling/apply_pass.h"
#include "coordinator/scheduling/scheduling_pass.h"
#include "coordinator/store/job_store.h"

namespace meshwright {

// Who a worker has shown to be.
struct WorkerIdentity {
  std::string owner;               // whose key or certificate it came with; "": nobody asked for one
  std::vector<std::string> names;  // that its certificate vouches for; none: it is known by a key
};

// The coordinator's side of the worker protocol, without a network. Who holds which job is in the JobStore alone, so
// any coordinator answers any worker. One thread makes passes: all calls that came since the pass before are answered
// from one look at the open jobs, and what they change is written in one transaction; calls that find nothing new wait
// without a thread of their own. Thread-safe.
class WorkerService {
 public:
  using Answer = std::function<void(absl::StatusOr<v1::SynchronizeResponse>)>;

  // `store` and `clock`, by whose uptime leases are timed, outlive it.
  WorkerService(const LeaseOptions& lease, const RetryOptions& retry, JobStore& store,
                const Clock& clock = SystemClock());
  ~WorkerService();

  // Answers up to request.wait_timeout_seconds later, while there is nothing that the worker does not know; from
  // another thread, and exactly once. InvalidArgument names the field. PermissionDenied: the worker's id is not one
  // that its certificate vouches for, or another owner's until that has been silent for long. Returns the call's
  // number.
  int64_t Synchronize(const v1::SynchronizeRequest& request, Answer answer, const WorkerIdentity& identity = {});
  // The caller does not wait any more: the answer is Cancelled, unless there was one already.
  void Abandon(int64_t call);
  // The same for callers that wait; `cancelled` is asked now and then.
  absl::StatusOr<v1::SynchronizeResponse> Synchronize(const v1::SynchronizeRequest& request,
                                                      const std::function<bool()>& cancelled);

  // The worker finishes what it holds and is given nothing more, by any coordinator (others notice within a second),
  // until its process is another one. Repeating it is harmless. NotFound: no such worker is known.
  absl::Status Drain(const std::string& worker);

  // There may be new jobs in the store.
  void Wake();
  // Called after each pass with each reconstruction that has new results, or blobs that could not be read.
  void SetListener(std::function<void(const std::string& reconstruction)> listener);

  int LeasesIn(const std::string& reconstruction) const;
  // What blocks its jobs: none of the workers is large enough, or there is none.
  // What is done before its cameras are there, in words; "": nothing of the kind.
  std::string StageOf(const std::string& reconstruction) const;
  std::vector<std::string> WarningsFor(const std::string& reconstruction) const;
  // Those of all coordinators, as of the last passes.
  v1::ListWorkersResponse ListWorkers() const;
  // What runs now, as attempts without ends; "" means of all reconstructions.
  std::vector<v1::Attempt> RunningIn(const std::string& reconstruction) const;
  // Everybody who waits gets an answer now.
  void Shutdown();

 private:
  struct Call {
    int64_t number = 0;
    v1::SynchronizeRequest request;
    WorkerReport report;  // the same
    WorkerIdentity identity;
    Answer answer;
    std::chrono::steady_clock::time_point deadline;
    bool is_heard = false;
    bool is_settled = false;  // the worker waits to hear that something was taken
  };
  // What a worker has to be told of a reconstruction beside its jobs.
  struct Background {
    std::string options_json;
    std::string scene_blob;
  };

  void Run();
  void AnswerCalls();
  absl::Status MakePass(std::list<Call>& calls);
  void Tell(const std::set<std::string>& news);
  std::vector<WorkerRecord> Heartbeats(const std::list<Call>& calls, absl::Time now);
  absl::Status LookAtWorkers(const std::list<Call>& calls, absl::Time now);
  void RefuseImpostors(std::list<Call>& calls) const;
  absl::StatusOr<v1::CameraJob> FullJob(const OpenJob& job);
  static absl::StatusOr<v1::CameraJob> EstimationJob(const OpenJob& job, const CameraJob& stored);
  absl::StatusOr<v1::CameraJob> RefinementJob(const OpenJob& job, const CameraJob& stored);
  void NoteSteps(const WorkerReport& report);
  bool IsAlive(const WorkerRecord& worker) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  bool HasWorkerWithColmap(int64_t method_version) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::StatusOr<Background> BackgroundOf(const std::string& reconstruction);
  absl::StatusOr<v1::SynchronizeResponse> AnswerTo(const Call& call, const std::vector<const OpenJob*>& held);
  void Publish(const SchedulingPass& pass, absl::Time now);

  const LeaseOptions lease_;
  const RetryOptions retry_;
  JobStore& store_;
  const Clock& clock_;

  // Of the thread alone.
  LeaseWatch watch_;
  std::map<std::pair<std::string, SequenceNumber>, CameraJob> claimed_;  // jobs that are leased from here, with specs
  std::map<std::string, Background> backgrounds_;
  std::map<std::string, WorkerRecord> written_workers_;
  absl::Time last_pass_ = absl::InfinitePast();
  std::chrono::steady_clock::time_point next_pause_ends_ = std::chrono::steady_clock::time_point::max();  // of a job
  absl::Time last_look_at_workers_ = absl::InfinitePast();

  mutable Mutex mutex_;
  ConditionVariable wake_;
  std::list<Call> calls_ ABSL_GUARDED_BY(mutex_);  // that wait; taken out while a pass deals with them
  std::vector<int64_t> abandoned_ ABSL_GUARDED_BY(mutex_);
  std::function<void(const std::string&)> listener_ ABSL_GUARDED_BY(mutex_);
  bool awake_ ABSL_GUARDED_BY(mutex_) = false;
  bool workers_changed_ ABSL_GUARDED_BY(mutex_) = false;  // in the store, by other ways than heartbeats from here
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;
  int64_t next_call_ ABSL_GUARDED_BY(mutex_) = 1;
  std::vector<OpenJob> seen_ ABSL_GUARDED_BY(mutex_);  // as of the last pass
  std::map<std::string, WorkerRecord> workers_ ABSL_GUARDED_BY(mutex_);
  std::map<std::string, JobRunning> steps_ ABSL_GUARDED_BY(mutex_);  // of estimating cameras, by reconstruction
  absl::Time seen_at_ ABSL_GUARDED_BY(mutex_) = absl::InfinitePast();
  std::thread thread_;
};

}  // namespace meshwright
