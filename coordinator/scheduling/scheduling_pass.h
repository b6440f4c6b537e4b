// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <absl/status/status.h>
#include <absl/time/time.h>

#include "coordinator/scheduling/lease_options.h"
#include "coordinator/scheduling/lease_watch.h"
#include "coordinator/scheduling/worker_report.h"
#include "coordinator/store/job_store.h"

namespace meshwright {

struct RetryOptions {
  int max_failures = 3;  // a camera whose job failed so often is skipped, >= 1
  // Losing workers says little about the camera; but one that takes every worker down must end too. >= 1
  int max_losses = 30;
  absl::Duration backoff = absl::Seconds(1);  // before the second attempt; doubles with each
  absl::Duration max_backoff = absl::Minutes(1);
};

// What is decided in one pass over the open jobs, from what the store says about them and what workers have said since
// the pass before. Pure: no threads, no clock, no store. What it decides is a list of changes, each fenced in the
// store, so that several coordinators may decide at the same time.
class SchedulingPass {
 public:
  // What a job needs when it is made smaller 0, 1, 2 ... times, bytes.
  using MemorySteps = std::function<std::vector<int64_t>(const OpenJob& job)>;

  // `lease`, `retry` and `watch`, which has observed `open`, outlive the pass. `now`: of the store, whose clock may
  // jump.
  SchedulingPass(const LeaseOptions& lease, const RetryOptions& retry, const LeaseWatch& watch,
                 std::vector<OpenJob> open, absl::Time now, MemorySteps memory_steps);

  // What a worker says: results, failures, what runs. Ends what an earlier process of it held. Returns whether there
  // was something that the worker waits to be rid of.
  bool ApplyReport(const WorkerReport& report);
  // Ends leases that ran out, or of jobs that take too long.
  void Expire();
  // Gives the worker what it can take and has the method for: of the reconstruction with the fewest leases for its
  // weight first, of one reconstruction by sequence.
  void Grant(const WorkerReport& report);

  struct Change {
    JobChange change;
    size_t job = 0;  // index into jobs()
  };
  const std::vector<Change>& changes() const { return changes_; }
  // The worker could not read these blobs: reconstruction, digest.
  const std::vector<std::pair<std::string, std::string>>& damaged_blobs() const { return damaged_blobs_; }
  const std::vector<OpenJob>& jobs() const { return jobs_; }
  // What a failure of a result that could not be stored changes.
  JobChange FailureOf(const OpenJob& job, const std::string& reason, bool out_of_memory) const;
  // Notes what has become of a change.
  void ApplyOutcome(const Change& change, const JobChangeResult& result);
  // Jobs of the worker's process, by reconstruction and sequence.
  std::vector<const OpenJob*> HeldBy(const std::string& worker, const std::string& instance) const;
  int LeasesIn(const std::string& reconstruction) const;
  // Until the first of the jobs that wait, with a pause after a failure, can be granted; infinite: there is none.
  absl::Duration UntilNextPauseEnds() const;

 private:
  JobChange LossOf(const OpenJob& job, const std::string& reason, bool out_of_memory) const;
  void ApplyHeldJob(const WorkerReport& report, const HeldJob& held);
  void ApplyFinished(size_t job, bool is_leased, const JobFinished& finished);
  void ApplyFailed(size_t job, const JobFailed& failed);
  void ApplyRunning(size_t job);
  void Add(size_t job, JobChange change);
  bool Fits(const OpenJob& job, const WorkerReport& report, int64_t free_bytes) const;
  absl::Duration TimeLimit(const OpenJob& job) const;

  const LeaseOptions& lease_;
  const RetryOptions& retry_;
  const LeaseWatch& watch_;
  const absl::Time now_;
  const MemorySteps memory_steps_;
  std::vector<OpenJob> jobs_;
  std::vector<bool> changed_;  // this pass has decided about the job
  std::map<std::pair<std::string, SequenceNumber>, size_t> by_name_;
  std::map<std::string, std::set<size_t>> by_worker_;
  struct Share {
    double weight = 1;
    int leases = 0;
    std::vector<size_t> waiting;  // by sequence
  };
  std::map<std::string, Share> shares_;
  std::vector<Change> changes_;
  std::vector<std::pair<std::string, std::string>> damaged_blobs_;
};

}  // namespace meshwright
