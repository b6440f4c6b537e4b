// SPDX-License-Identifier: Apache-2.0
#include "coordinator/conductor/conductor_lease.h"

#include <utility>

#include "common/base/status_macros.h"

namespace meshwright {

HeldConductorLease::HeldConductorLease(JobStore& store, std::string reconstruction, int64_t epoch,
                                       absl::Duration duration, absl::Time now)
    : store_(&store),
      reconstruction_(std::move(reconstruction)),
      epoch_(epoch),
      duration_(duration),
      renewed_at_(now) {}

absl::StatusOr<HeldConductorLease> HeldConductorLease::Acquire(JobStore& store, const std::string& reconstruction,
                                                               const std::string& owner, absl::Duration duration,
                                                               absl::Time now, absl::Time lapsed_by) {
  MW_ASSIGN_OR_RETURN(const int64_t epoch,
                      store.AcquireConductorLease(reconstruction, owner, now + duration, lapsed_by));
  return HeldConductorLease(store, reconstruction, epoch, duration, now);
}

absl::Status HeldConductorLease::RenewIfDue(absl::Time now) {
  // A clock that was set back makes a lease of more time than was meant, until it is written again.
  const absl::Duration gone = now - renewed_at_;
  if (gone >= absl::ZeroDuration() && gone < duration_ / 2) return absl::OkStatus();
  MW_RETURN_IF_ERROR(store_->RenewConductorLease(reconstruction_, epoch_, now + duration_, now));
  renewed_at_ = now;
  return absl::OkStatus();
}

absl::Status HeldConductorLease::Release(absl::Time now) {
  return store_->ReleaseConductorLease(reconstruction_, epoch_, now);
}

}  // namespace meshwright
