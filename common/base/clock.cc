// SPDX-License-Identifier: Apache-2.0
#include "common/base/clock.h"

#include <chrono>

#include <absl/time/clock.h>

namespace meshwright {

absl::Time RealClock::Now() const { return absl::Now(); }

absl::Duration RealClock::Uptime() const {
  return absl::FromChrono(std::chrono::steady_clock::now().time_since_epoch());
}

const Clock& SystemClock() {
  static const RealClock clock;
  return clock;
}

}  // namespace meshwright
