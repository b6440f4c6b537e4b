// SPDX-License-Identifier: Apache-2.0
#include "coordinator/schedule/schedule.h"

#include <absl/strings/str_cat.h>

#include "common/base/check.h"
#include "common/base/out_of_range.h"
#include "common/base/status_macros.h"

namespace meshwright {

absl::Status ScheduleOptions::Validate() const {
  if (window < 1) return OutOfRange("window", window, ">= 1");
  if (max_overlap_in_flight < 0) {
    return OutOfRange("max_overlap_in_flight", max_overlap_in_flight, ">= 0");
  }
  return absl::OkStatus();
}

Schedule::Schedule(IncidenceMatrix matrix, OverlapGraph overlaps, const ScheduleOptions& options)
    : matrix_(std::move(matrix)),
      overlaps_(std::move(overlaps)),
      options_(options),
      state_(static_cast<size_t>(matrix_.cameras()), State::kWaiting),
      in_flight_overlaps_(static_cast<size_t>(matrix_.cameras()), 0) {
  MW_CHECK(matrix_.cameras() == overlaps_.cameras());
  for (CameraIndex camera = 0; camera < matrix_.cameras(); ++camera) {
    waiting_cameras_ += matrix_.RowSum(camera) > 0 ? 1 : 0;
    Insert(camera);
  }
  Choose();
}

absl::StatusOr<Schedule> Schedule::Replay(IncidenceMatrix matrix, OverlapGraph overlaps, const ScheduleOptions& options,
                                          const std::vector<JobOutcome>& commits) {
  Schedule schedule(std::move(matrix), std::move(overlaps), options);
  for (const JobOutcome& commit : commits) MW_RETURN_IF_ERROR(schedule.Commit(commit));
  return schedule;
}

std::vector<Assignment> Schedule::TakeChoices() {
  std::vector<Assignment> choices;
  for (const Assignment& assignment : in_flight_) {
    if (assignment.sequence > taken_) choices.push_back(assignment);
  }
  taken_ = chosen_;
  return choices;
}

bool Schedule::IsToCome(CameraIndex camera) const {
  const State state = state_[static_cast<size_t>(camera)];
  return state == State::kInFlight || (state == State::kWaiting && matrix_.RowSum(camera) > 0);
}

absl::Status Schedule::Commit(const JobOutcome& commit) {
  if (in_flight_.empty() || commit.sequence != in_flight_.front().sequence) {
    return absl::InvalidArgumentError(absl::StrCat("commit ", commit.sequence, ": expected the next in order, ",
                                                   commits_ + 1,
                                                   in_flight_.empty() ? ", but nothing is in flight" : ""));
  }
  const CameraIndex camera = in_flight_.front().camera;
  if (commit.camera != camera) {
    return absl::InvalidArgumentError(absl::StrCat("commit ", commit.sequence, ": camera ", commit.camera,
                                                   ", expected the one that was chosen, ", camera));
  }
  for (const CameraIndex target : commit.weak_targets) {
    if (target >= 0 && target < matrix_.cameras() && target != camera) continue;
    return absl::InvalidArgumentError(absl::StrCat("commit ", commit.sequence, ": weak target ", target,
                                                   ", expected another camera below ", matrix_.cameras()));
  }

  in_flight_.pop_front();
  ++commits_;
  state_[static_cast<size_t>(camera)] = State::kDone;
  matrix_.ClearRow(camera);
  for (const CameraIndex target : commit.weak_targets) {
    if (!matrix_.Get(target, camera)) continue;
    Remove(target);
    matrix_.Clear(camera, target);
    if (state_[static_cast<size_t>(target)] == State::kWaiting && matrix_.RowSum(target) == 0) --waiting_cameras_;
    Insert(target);
  }
  CountInFlightOverlap(camera, -1);
  Choose();
  return absl::OkStatus();
}

bool Schedule::Qualifies(CameraIndex camera) const {
  const auto i = static_cast<size_t>(camera);
  return state_[i] == State::kWaiting && matrix_.RowSum(camera) > 0 &&
         in_flight_overlaps_[i] <= options_.max_overlap_in_flight;
}

// Call before whatever the camera's key or qualification depends on changes, and Insert after it.
void Schedule::Remove(CameraIndex camera) { candidates_.erase({-matrix_.RowSum(camera), camera}); }

void Schedule::Insert(CameraIndex camera) {
  if (Qualifies(camera)) candidates_.insert({-matrix_.RowSum(camera), camera});
}

void Schedule::CountInFlightOverlap(CameraIndex camera, int change) {
  for (const CameraIndex other : overlaps_.Of(camera)) {
    const bool qualified = Qualifies(other);
    in_flight_overlaps_[static_cast<size_t>(other)] += change;
    if (qualified == Qualifies(other)) continue;
    if (qualified) {
      Remove(other);
    } else {
      Insert(other);
    }
  }
}

void Schedule::Choose() {
  while (static_cast<int>(in_flight_.size()) < options_.window && !candidates_.empty()) {
    const CameraIndex camera = candidates_.begin()->second;
    candidates_.erase(candidates_.begin());
    state_[static_cast<size_t>(camera)] = State::kInFlight;
    --waiting_cameras_;
    in_flight_.push_back(
        {.sequence = ++chosen_, .camera = camera, .snapshot = commits_, .neighbours = matrix_.Neighbours(camera)});
    CountInFlightOverlap(camera, 1);
  }
}

}  // namespace meshwright
