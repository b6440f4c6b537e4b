#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/base/clock.h"
#include "common/base/ids.h"
#include "common/base/thread_pool.h"
#include "common/blob/blob_store.h"
#include "common/geometry/camera.h"
#include "common/job/camera_job_spec.h"
#include "common/scene/scene.h"
#include "common/surface/sparse_surface.h"
#include "coordinator/acceptance/acceptance.h"
#include "coordinator/incidence/feasible_pairs.h"
#include "coordinator/incidence/overlap_graph.h"
#include "coordinator/options/conductor_options.h"
#include "coordinator/schedule/schedule.h"
#include "coordinator/store/job_store.h"

namespace meshwright {

struct Progress {
  int cameras_total = 0;      // committed, in flight and still waiting; shrinks when pruning leaves a camera no pair
  int cameras_committed = 0;  // skipped ones included
  int cameras_skipped = 0;
  int cameras_in_flight = 0;
  int64_t patches_filtered = 0;  // over committed cameras
  int64_t patches_accepted = 0;
};

// Who a conductor works for.
struct ConductorLeaseTerms {
  // Of its lease in the store, which fences its writes; camera jobs are handed out from the store then, whoever asks
  // there, and IngestResults() looks for their results. 0: it is the only one that writes to the store, hands jobs out
  // by TakeJobs() and is told their results by Complete().
  int64_t epoch = 0;
  // Bytes that a job takes at most when it is made smaller 0, 1, 2 ... times. May be empty.
  std::function<std::vector<int64_t>(const CameraJobSpec& spec)> job_bytes;
};

// Conducts one reconstruction: which camera is processed when (schedule), what it is given (targets, accepted
// surfaces), which of its patches are accepted (section 3.7, Jancosek et al. 2009), in the one order of the order rule.
// Everything that has happened is in the JobStore; opening replays it, so a conductor may die at any moment. It has no
// threads and knows nothing of how jobs are done.
//
// Thread-safe: calls take a mutex. Complete() and Skip() commit whatever has become next in line, which loads the
// filtered surfaces of overlapping cameras one after the other (tenths of a second each on large photographs); at most
// three surfaces are in memory. Errors of the store and the BlobStore come back as they are; after one, a conductor
// opened anew is in order, and after DataLoss or NotFound of a blob, which damaged_blob() then names, this one is too:
// once the blob is mended, IngestResults() goes on.
class Conductor {
 public:
  // The reconstruction must exist in `store`. `store`, `blobs`, `clock` and `pool` outlive the conductor. Jobs that
  // were handed out before and not finished get a new epoch and are handed out again. FailedPrecondition when no pair
  // of cameras is feasible; DataLoss when the store's rows are not of this scene and these options.
  static absl::StatusOr<std::unique_ptr<Conductor>> Open(const std::string& reconstruction_id,
                                                         const std::vector<Camera>& cameras,
                                                         const std::vector<SparsePoint>& points,
                                                         const ConductorOptions& options, JobStore* store,
                                                         BlobStore* blobs, const Clock* clock, ThreadPool* pool,
                                                         ConductorLeaseTerms terms = {});

  // Jobs that may start now and were not taken since the last commit that made them possible. Often empty.
  std::vector<CameraJobSpec> TakeJobs();

  // The result of a job: F_r, durable in the BlobStore under `filtered_digest`; `weak_targets` are pairs with fewer
  // than m_S seeds; `report_json` is kept as it is. In any order; repeating it is harmless. Aborted: the job was handed
  // out again, drop the result.
  absl::Status Complete(SequenceNumber sequence, int64_t epoch, const std::string& filtered_digest,
                        const std::vector<CameraIndex>& weak_targets, const std::string& report_json);
  // Gives a job up: its camera contributes nothing and is nobody's target any more.
  absl::Status Skip(SequenceNumber sequence, int64_t epoch, const std::string& reason);

  // With an terms: takes what has been done since the last call from the store and commits what is next. Returns
  // whether jobs were handed out. Results that are none (weak targets that are no neighbours, a surface that is not
  // there or cannot be decoded) are taken back, after `max_failures` of them the job is skipped.
  absl::StatusOr<bool> IngestResults(int max_failures);
  // "" unless the last call failed since this blob is damaged or lost.
  std::string damaged_blob() const;
  // Makes M_r of a commit again from the filtered surfaces: the same bytes, so the blob is mended.
  absl::Status RemakeAccepted(const std::string& accepted_digest);
  // The committed or finished camera job whose filtered surface this is; 0 when there is none.
  SequenceNumber JobOfFiltered(const std::string& filtered_digest) const;

  Progress progress() const;
  // All cameras are committed.
  bool finished() const;
  // In the order of commits, which is the order of the mesh.
  std::vector<AcceptedSurface> AcceptedSurfaces() const;

  const FeasiblePairCounts& pair_counts() const { return pair_counts_; }
  FeasibilitySource feasibility_source() const { return feasibility_source_; }

 private:
  struct Outcome {  // of a finished job
    std::string filtered_digest;
    std::vector<CameraIndex> weak_targets;
    bool skipped = false;
    int64_t epoch = 0;
  };
  struct Committed {
    SequenceNumber sequence = 0;
    std::string filtered_digest;  // "" when there is no patch in it
    int64_t filtered_patches = 0;
    AcceptedSurface accepted;  // its digest is "" when nothing was accepted
  };

  Conductor(std::string reconstruction_id, const std::vector<Camera>& cameras, FeasiblePairs pairs,
            OverlapGraph overlaps, const ConductorOptions& options, JobStore* store, BlobStore* blobs,
            const Clock* clock, ThreadPool* pool, ConductorLeaseTerms terms);

  absl::Status Replay(const std::vector<CameraJob>& jobs, const std::vector<Commit>& commits);
  void Assign(const Assignment& assignment);
  absl::Status Flush();
  absl::StatusOr<std::shared_ptr<const SparseSurface>> LoadSurface(const std::string& digest,
                                                                   CameraIndex expected_camera);
  absl::Status Reject(SequenceNumber sequence, int64_t epoch, const std::string& reason, int max_failures);
  absl::StatusOr<const Assignment*> FindInFlight(SequenceNumber sequence) const;
  absl::Status CommitWhatIsNext();
  absl::StatusOr<Commit> Accept(SequenceNumber sequence, CameraIndex camera, const std::string& filtered_digest);
  Progress CurrentProgress() const;
  void Remember(const Commit& commit, const Outcome& outcome);
  CommitRecord RecordFor(const Assignment& assignment, const Outcome& outcome) const;
  CameraJobSpec SpecFor(const Assignment& assignment, int64_t epoch) const;

  const std::string reconstruction_id_;
  const std::vector<CameraGeometry> cameras_;
  const std::vector<CameraProbes> probes_;
  const FeasiblePairCounts pair_counts_;
  const FeasibilitySource feasibility_source_;
  const OverlapGraph overlaps_;
  const ConductorOptions options_;
  JobStore* const store_;
  BlobStore* const blobs_;
  const Clock* const clock_;
  ThreadPool* const pool_;
  const ConductorLeaseTerms terms_;

  mutable std::mutex mutex_;
  Schedule schedule_;
  std::vector<CameraJobSpec> ready_;            // chosen and not taken
  std::map<SequenceNumber, Outcome> finished_;  // finished and not committed
  std::map<CameraIndex, Committed> committed_;
  std::vector<Commit> unwritten_commits_;  // decided and not in the store yet
  std::vector<CameraAssignment> unwritten_assignments_;
  std::string damaged_blob_;
  Progress progress_;
};

}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
