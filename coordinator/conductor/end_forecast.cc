// SPDX-License-Identifier: Apache-2.0
#include "coordinator/conductor/end_forecast.h"

#include <algorithm>
#include <vector>

#include "common/base/status_macros.h"
#include "coordinator/forecast/job_times.h"

namespace meshwright {
namespace {

constexpr absl::Duration kLookEvery = absl::Seconds(1);
// As many jobs before this process's time tell what a camera takes.
constexpr SequenceNumber kJobsBefore = 50;

}  // namespace

EndForecast::EndForecast(const std::string& reconstruction, const Conductor& conductor, JobStore& store,
                         const Clock& clock)
    : reconstruction_(reconstruction),
      conductor_(conductor),
      store_(store),
      clock_(clock),
      since_begin_(clock),
      since_look_(clock),
      begun_at_(static_cast<SequenceNumber>(conductor.progress().cameras_committed)),
      taken_(std::max<SequenceNumber>(0, begun_at_ - kJobsBefore)) {}

absl::Status EndForecast::TakeReports() {
  const auto commits = static_cast<SequenceNumber>(conductor_.progress().cameras_committed);
  if (commits <= taken_) return absl::OkStatus();
  MW_ASSIGN_OR_RETURN(const std::vector<CameraJob> jobs, store_.ListCameraJobs(reconstruction_, taken_));
  for (const CameraJob& job : jobs) {
    if (job.sequence > commits) break;
    taken_ = job.sequence;
    if (job.state != CameraJobState::kDone) continue;
    const JobTimes times = TimesOfReport(job.report_json);
    rate_.Add(times, conductor_.ExpectedRays(job.camera));
    if (job.sequence <= begun_at_) continue;
    done_seconds_ += times.seconds();
    ++done_cameras_;
    elapsed_seconds_ = since_begin_.Seconds();
  }
  return absl::OkStatus();
}

absl::StatusOr<absl::Time> EndForecast::ExpectedEnd() {
  if (has_looked_ && since_look_.Elapsed() < kLookEvery) return expected_end_;
  has_looked_ = true;
  since_look_ = Stopwatch(clock_);
  const SequenceNumber before = taken_;
  MW_RETURN_IF_ERROR(TakeReports());
  if (taken_ == before) return expected_end_;
  const ForecastInput input = conductor_.ForecastNow();
  const double cameras = CameraSecondsLeft(rate_, input.left, done_seconds_, done_cameras_, elapsed_seconds_);
  if (cameras >= 0)
    expected_end_ = clock_.Now() + absl::Seconds(cameras + input.judging_seconds + input.joining_seconds);
  return expected_end_;
}

}  // namespace meshwright
