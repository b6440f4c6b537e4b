// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/statusor.h>
#include <absl/time/time.h>

#include "common/base/clock.h"
#include "coordinator/conductor/conductor.h"
#include "coordinator/forecast/time_left.h"
#include "coordinator/store/job_store.h"

namespace meshwright {

// Says when a reconstruction will presumably be done, mesh included, from what its jobs took. All of it outlives the
// forecast, which belongs to one thread at a time.
class EndForecast {
 public:
  EndForecast(const std::string& reconstruction, const Conductor& conductor, JobStore& store, const Clock& clock);

  // InfinitePast while nothing can be said. Looks into the store for jobs that are done, at most once a second: within
  // it the answer stays. Errors are the store's.
  absl::StatusOr<absl::Time> ExpectedEnd();

 private:
  absl::Status TakeReports();

  const std::string reconstruction_;
  const Conductor& conductor_;
  JobStore& store_;
  const Clock& clock_;
  const Stopwatch since_begin_;
  Stopwatch since_look_;
  bool has_looked_ = false;
  SequenceNumber begun_at_ = 0;  // commits when this process took it up: their jobs say nothing of how fast it goes now
  SequenceNumber taken_ = 0;     // jobs up to this one are in rate_
  JobRate rate_;
  double done_seconds_ = 0;     // of the jobs of this process's time,
  int64_t done_cameras_ = 0;    // committed since
  double elapsed_seconds_ = 0;  // when the last of them was committed
  absl::Time expected_end_ = absl::InfinitePast();
};

}  // namespace meshwright
