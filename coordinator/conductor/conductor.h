// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/base/clock.h"
#include "common/base/ids.h"
#include "common/base/mutex.h"
#include "common/base/thread_pool.h"
#include "common/blob/blob_store.h"
#include "common/geometry/camera.h"
#include "common/job/camera_job_spec.h"
#include "common/scene/scene.h"
#include "common/surface/sparse_surface.h"
#include "coordinator/acceptance/acceptance.h"
#include "coordinator/forecast/surface_to_grow.h"
#include "coordinator/forecast/time_left.h"
#include "coordinator/incidence/feasible_pairs.h"
#include "coordinator/incidence/overlap_graph.h"
#include "coordinator/options/conductor_options.h"
#include "coordinator/schedule/schedule.h"
#include "coordinator/store/job_store.h"

namespace meshwright {

// Bytes that a job takes at most when it is made smaller 0, 1, 2 ... times.
using JobBytes = std::function<std::vector<int64_t>(const CameraJobSpec& spec)>;

// A camera that is committed, and what of others there is to judge its surface by.
struct CommittedSurface {
  struct Supporter {
    CameraIndex camera = 0;
    std::string digest;  // of its F_i
    int64_t patches = 0;
  };
  AcceptedSurface accepted;           // M_r; its digest is "" when nothing was accepted
  std::string filtered_digest;        // F_r
  std::vector<Supporter> supporters;  // of the cameras that overlap it, ascending
};

// What is still to come, as far as it can be said now.
struct ForecastInput {
  CameraWork left;             // cameras that are not committed
  double judging_seconds = 0;  // of judging all surfaces again once they are, and of the mesh; measured on what was
  double joining_seconds = 0;  // accepted so far, 0 before
};

// Conducts one reconstruction: which camera is processed when (schedule), what it is given (targets, accepted
// surfaces), which of its patches are accepted (section 3.7, Jancosek et al. 2009), in the one order of the order rule.
// Everything that has happened is in the JobStore; opening replays it, so a conductor may die at any moment. It has no
// threads and knows nothing of how jobs are done: it writes jobs to the store, whoever asks there does them
// (SchedulingPass), and it finds their results there.
//
// Thread-safe: calls take a mutex. IngestResults() commits whatever has become next in line, which loads the filtered
// surfaces of overlapping cameras one after the other (tenths of a second each on large photographs); at most three
// surfaces are in memory. Errors of the store and the BlobStore come back as they are; after one, a conductor opened
// anew is in order, and after DataLoss or NotFound of a blob, which damaged_blob() then names, this one is too: once
// the blob is mended, IngestResults() goes on. Aborted: somebody else has the lease.
class Conductor {
 public:
  // The reconstruction must exist in `store`, and `epoch` be that of its conductor's lease. `store`, `blobs`, `clock`
  // and `pool` outlive the conductor. FailedPrecondition when no pair of cameras is feasible; DataLoss when the store's
  // rows are not of this scene and these options.
  static absl::StatusOr<std::unique_ptr<Conductor>> Open(const std::string& reconstruction_id,
                                                         const std::vector<Camera>& cameras,
                                                         const std::vector<SparsePoint>& points,
                                                         const ConductorOptions& options, JobStore* store,
                                                         BlobStore* blobs, const Clock* clock, ThreadPool* pool,
                                                         int64_t epoch, JobBytes job_bytes);

  // Takes what has been done since the last call from the store and commits what is next. Returns whether jobs were
  // written. Results that are none (weak targets that are no neighbours, a surface that is not there or cannot be
  // decoded) are taken back, after `max_failures` of them the job is skipped: its camera contributes nothing and is
  // nobody's target any more.
  absl::StatusOr<bool> IngestResults(int max_failures);
  // "" unless the last call failed since this blob is damaged or lost.
  std::string damaged_blob() const;
  // Whether this is M_r of a commit.
  bool HasAccepted(const std::string& accepted_digest) const;
  // Makes M_r of a commit again from the filtered surfaces: the same bytes, so the blob is mended.
  absl::Status RemakeAccepted(const std::string& accepted_digest);
  // The committed or finished camera job whose filtered surface this is; 0 when there is none.
  SequenceNumber JobOfFiltered(const std::string& filtered_digest) const;

  Progress progress() const;
  // All cameras are committed.
  bool finished() const;
  // In the order of commits, which is the order of the mesh.
  std::vector<AcceptedSurface> AcceptedSurfaces() const;
  // Every committed camera that found something, in the order of commits, with supporters from before and after it.
  std::vector<CommittedSurface> CommittedSurfaces() const;

  ForecastInput ForecastNow() const;
  // Of a committed camera: rays that it was expected to grow.
  double ExpectedRays(CameraIndex camera) const;
  // Is told with the progress in the store from the next commit on.
  void SetExpectedEnd(absl::Time expected_end);

  const FeasiblePairCounts& pair_counts() const { return pair_counts_; }
  FeasibilitySource feasibility_source() const { return feasibility_source_; }

 private:
  struct Committed {
    SequenceNumber sequence = 0;
    std::string filtered_digest;  // "" when there is no patch in it
    int64_t filtered_patches = 0;
    AcceptedSurface accepted;  // its digest is "" when nothing was accepted
    double expected_rays = 0;  // that it was to grow
  };
  // How long acceptance took so far, to tell how long it will take to judge all again and to join.
  struct AcceptanceTimes {
    double seconds = 0;
    double comparisons = 0;  // patches times surfaces that they were held against
  };

  Conductor(std::string reconstruction_id, const std::vector<Camera>& cameras, FeasiblePairs pairs,
            OverlapGraph overlaps, const ConductorOptions& options, JobStore* store, BlobStore* blobs,
            const Clock* clock, ThreadPool* pool, int64_t epoch, JobBytes job_bytes);

  absl::Status Replay(const std::vector<CameraJob>& jobs, const std::vector<Commit>& commits)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Assign(const Assignment& assignment) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::Status Flush() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // InvalidArgument: it is no surface of this camera of the scene.
  absl::StatusOr<std::shared_ptr<const SparseSurface>> LoadSurface(const std::string& digest, CameraIndex camera)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::Status Receive(const JobResult& result, int max_failures) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::Status Reject(const JobResult& result, const std::string& reason, int max_failures)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::StatusOr<const Assignment*> FindInFlight(SequenceNumber sequence) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::Status CommitWhatIsNext() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  std::vector<CommittedSurface::Supporter> SupportersOf(CameraIndex camera, SequenceNumber before) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::StatusOr<Commit> Accept(SequenceNumber sequence, CameraIndex camera, const std::string& filtered_digest)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  SequenceNumber LastChoice() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  double RaysOf(CameraIndex camera) const;
  Progress CurrentProgress() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Remember(const Commit& commit, const JobResult& result) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  JobOutcome OutcomeOf(const Assignment& assignment, const JobResult& result) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  CameraJobSpec SpecFor(const Assignment& assignment) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const std::string reconstruction_id_;
  const std::vector<Camera> scene_cameras_;
  const std::vector<CameraGeometry> cameras_;  // of these
  const std::vector<CameraProbes> probes_;
  const FeasiblePairCounts pair_counts_;
  const FeasibilitySource feasibility_source_;
  const OverlapGraph overlaps_;
  const ConductorOptions options_;
  JobStore* const store_;
  BlobStore* const blobs_;
  const Clock* const clock_;
  ThreadPool* const pool_;
  const int64_t epoch_;  // of the lease in the store, which fences all writes
  const JobBytes job_bytes_;

  mutable Mutex mutex_;
  Schedule schedule_ ABSL_GUARDED_BY(mutex_);
  std::map<SequenceNumber, JobResult> finished_ ABSL_GUARDED_BY(mutex_);  // finished and not committed
  std::map<CameraIndex, Committed> committed_ ABSL_GUARDED_BY(mutex_);
  std::vector<Commit> unwritten_commits_ ABSL_GUARDED_BY(mutex_);  // decided and not in the store yet
  std::vector<CameraAssignment> unwritten_assignments_ ABSL_GUARDED_BY(mutex_);
  std::string damaged_blob_ ABSL_GUARDED_BY(mutex_);
  Progress progress_ ABSL_GUARDED_BY(mutex_);
  SurfaceToGrow to_grow_ ABSL_GUARDED_BY(mutex_);
  AcceptanceTimes acceptance_times_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace meshwright
