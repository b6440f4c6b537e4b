// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/lease_watch.h"

#include <algorithm>
#include <utility>

namespace meshwright {

void LeaseWatch::Observe(const std::vector<OpenJob>& open, absl::Duration uptime) {
  const bool after_pause = uptime - now_ > lease_.lease / 2;
  now_ = uptime;
  std::map<JobKey, Seen> leases;
  for (const OpenJob& job : open) {
    if (job.lease_worker.empty()) continue;
    Seen seen = {.expires_at = job.lease_expires_at, .unchanged_since = now_, .first = now_};
    if (const auto before = leases_.find(KeyOf(job)); before != leases_.end()) {
      seen.first = before->second.first;
      if (before->second.expires_at == seen.expires_at) seen.unchanged_since = before->second.unchanged_since;
    }
    if (after_pause) seen.unchanged_since = std::max(seen.unchanged_since, now_ - lease_.lease / 2);
    leases[KeyOf(job)] = seen;
  }
  leases_ = std::move(leases);
}

bool LeaseWatch::HasRunOut(const OpenJob& job) const {
  const auto seen = leases_.find(KeyOf(job));
  return seen != leases_.end() && now_ - seen->second.unchanged_since >= lease_.lease;
}

bool LeaseWatch::TakesTooLong(const OpenJob& job, absl::Duration limit) const {
  const auto seen = leases_.find(KeyOf(job));
  return seen != leases_.end() && now_ - seen->second.first > limit;
}

}  // namespace meshwright
