// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <absl/status/status.h>
#include <absl/time/time.h>

namespace meshwright {

struct LeaseOptions {
  absl::Duration lease = absl::Seconds(30);        // a worker that is silent longer has lost its jobs
  absl::Duration job_time_limit = absl::Hours(2);  // a job that takes longer has failed, however alive its worker is

  absl::Status Validate() const;
};

}  // namespace meshwright
