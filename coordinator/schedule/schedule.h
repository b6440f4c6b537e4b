// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <set>
#include <utility>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/base/ids.h"
#include "coordinator/incidence/incidence_matrix.h"
#include "coordinator/incidence/overlap_graph.h"

namespace meshwright {

struct ScheduleOptions {
  int window = 4;                 // W: cameras chosen and not yet committed, >= 1; 1 is the paper's sequential method
  int max_overlap_in_flight = 1;  // K_a: a camera is chosen only if it overlaps at most so many in flight, >= 0

  absl::Status Validate() const;
};

// A camera to process: one job.
struct Assignment {
  SequenceNumber sequence = 0;          // 1, 2, 3 ...
  CameraIndex camera = 0;               // the reference camera r
  SequenceNumber snapshot = 0;          // V_r holds exactly the surfaces accepted in commits <= snapshot
  std::vector<CameraIndex> neighbours;  // O_r in that snapshot, ascending

  friend bool operator==(const Assignment&, const Assignment&) = default;
};

// How a job ended; what has to be kept to replay a schedule.
struct JobOutcome {
  SequenceNumber sequence = 0;
  CameraIndex camera = 0;
  // Pairs (camera, t) to remove from the incidence matrix: fewer than m_S seeds (section 3.5). A camera that was set
  // aside because its image cannot be used names all its neighbours here, so that nobody asks for the image again.
  std::vector<CameraIndex> weak_targets;
  bool skipped = false;  // given up after repeated failures: the commit is empty, the schedule goes on

  friend bool operator==(const JobOutcome&, const JobOutcome&) = default;
};

// The order rule: which reference camera is processed when, and on which snapshot of the accepted surface. A pure state
// machine without threads, clocks or files: its choices are a function of the matrix, the overlaps, the options and the
// commits so far, whatever ran where and whenever it ended.
//
// After every commit c, while fewer than W cameras are in flight: choose the camera with the largest row sum in the
// incidence matrix as it stands after commit c, among cameras that overlap at most K_a cameras in flight; ties go to
// the lowest index; if none qualifies, wait for the next commit. Commits come strictly in order.
//
// Decision: what "processed cameras are zeroed" (section 3.4, Jancosek et al. 2009) zeroes. Context: the matrix picks
// the next reference and says what its targets are. Zeroing a processed camera's row and column would take it away as a
// target too, and a camera whose neighbours have all been processed would never be processed, though it may see surface
// that they did not grow, and K_a + 1 cameras must grow a surface before it is accepted. Decision: the row is zeroed
// and the column stays; only weak pairs leave both. Consequences: every camera with a feasible pair is processed
// exactly once unless commits remove its last pair first; row sums count all feasible targets, processed or not;
// cameras in flight are only taken out as candidates.
class Schedule {
 public:
  // `matrix` and `overlaps` are over the same cameras; `options` are valid.
  Schedule(IncidenceMatrix matrix, OverlapGraph overlaps, const ScheduleOptions& options);

  // The schedule after these commits, in order. TakeChoices() gives what is still in flight. InvalidArgument when they
  // are not commits of this schedule.
  static absl::StatusOr<Schedule> Replay(IncidenceMatrix matrix, OverlapGraph overlaps, const ScheduleOptions& options,
                                         const std::vector<JobOutcome>& commits);

  // Cameras chosen since the last call, in sequence.
  std::vector<Assignment> TakeChoices();

  // Ends the job `outcome.sequence`, which must be commits() + 1 and in flight. InvalidArgument, and no change, when
  // the outcome does not fit.
  absl::Status Commit(const JobOutcome& outcome);

  SequenceNumber commits() const { return commits_; }
  // Chosen and not committed, in sequence.
  const std::deque<Assignment>& in_flight() const { return in_flight_; }
  // Nothing in flight and nothing left to choose.
  bool finished() const { return in_flight_.empty() && waiting_cameras_ == 0; }
  // Cameras with a row left that are not in flight: what is still to come, unless pruned.
  int waiting_cameras() const { return waiting_cameras_; }
  // In flight, or waiting.
  bool IsToCome(CameraIndex camera) const;
  // The matrix after commit commits(); rows of processed cameras are empty.
  const IncidenceMatrix& matrix() const { return matrix_; }

 private:
  enum class State : uint8_t { kWaiting, kInFlight, kDone };
  using Key = std::pair<int, CameraIndex>;  // (-row sum, camera): the first is the choice

  bool Qualifies(CameraIndex camera) const;
  void Remove(CameraIndex camera);
  void Insert(CameraIndex camera);
  void CountInFlightOverlap(CameraIndex camera, int change);
  void Choose();

  IncidenceMatrix matrix_;
  OverlapGraph overlaps_;
  ScheduleOptions options_;
  SequenceNumber commits_ = 0;
  SequenceNumber chosen_ = 0;
  SequenceNumber taken_ = 0;
  std::deque<Assignment> in_flight_;
  std::vector<State> state_;
  std::vector<int> in_flight_overlaps_;  // per camera: how many cameras in flight it overlaps
  std::set<Key> candidates_;             // waiting cameras that qualify, so that a choice is O(log N)
  int waiting_cameras_ = 0;
};

}  // namespace meshwright
