// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <vector>

#include <absl/time/time.h>

#include "coordinator/scheduling/lease_options.h"
#include "coordinator/scheduling/worker_report.h"
#include "coordinator/store/job_store.h"

namespace meshwright {

// How long leases of camera jobs have stood in the store as they are, by the uptime of this process's clock. Times in
// the store are of a clock that may jump, by an hour at that: what they say is never held against a worker.
class LeaseWatch {
 public:
  explicit LeaseWatch(const LeaseOptions& lease) : lease_(lease) {}

  // What the store says now. Who is not looked at for more than half a lease gets half a lease more: its worker could
  // not be heard.
  void Observe(const std::vector<OpenJob>& open, absl::Duration uptime);
  // Its worker has not renewed it for the length of a lease.
  bool HasRunOut(const OpenJob& job) const;
  bool TakesTooLong(const OpenJob& job, absl::Duration limit) const;

 private:
  struct Seen {
    absl::Time expires_at;           // as stored
    absl::Duration unchanged_since;  // uptime, as the next
    absl::Duration first;
  };

  const LeaseOptions lease_;
  absl::Duration now_ = -absl::InfiniteDuration();
  std::map<JobKey, Seen> leases_;
};

}  // namespace meshwright
