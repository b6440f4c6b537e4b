// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/time/time.h>

#include "coordinator/store/job_store.h"

namespace meshwright {

// The right to conduct one reconstruction, as it stands in the store. Its epoch fences what the holder writes there:
// whoever has lost it, and does not know yet, changes nothing any more. Not thread-safe.
class HeldConductorLease {
 public:
  // FailedPrecondition while somebody else holds it: one that lasts beyond `lapsed_by`. `owner` takes back what it held
  // itself, in a new epoch. `store` outlives the lease.
  static absl::StatusOr<HeldConductorLease> Acquire(JobStore& store, const std::string& reconstruction,
                                                    const std::string& owner, absl::Duration duration, absl::Time now,
                                                    absl::Time lapsed_by);

  int64_t epoch() const { return epoch_; }
  // Writes when half of the time has gone. Aborted: somebody else has it.
  absl::Status RenewIfDue(absl::Time now);
  // Others may take over at once.
  absl::Status Release(absl::Time now);

 private:
  HeldConductorLease(JobStore& store, std::string reconstruction, int64_t epoch, absl::Duration duration,
                     absl::Time now);

  JobStore* store_;
  std::string reconstruction_;
  int64_t epoch_;
  absl::Duration duration_;
  absl::Time renewed_at_;
};

}  // namespace meshwright
