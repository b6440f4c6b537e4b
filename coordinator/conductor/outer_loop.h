// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/base/clock.h"
#include "common/base/mutex.h"
#include "common/base/thread_pool.h"
#include "common/blob/blob_store.h"
#include "common/scene/scene.h"
#include "coordinator/conductor/conductor.h"
#include "coordinator/conductor/end_forecast.h"
#include "coordinator/conductor/reconstruction_config.h"
#include "coordinator/store/job_store.h"

namespace meshwright {

// What an outer loop works with. All of it outlives the loop.
struct OuterLoopEnvironment {
  JobStore* store = nullptr;
  BlobStore* blobs = nullptr;
  const Clock* clock = nullptr;
  ThreadPool* pool = nullptr;  // acceptance
  int max_failures = 3;        // a camera whose job failed so often is skipped, >= 1
};

// The outer loop of section 3.1 (Jancosek et al. 2009) over the cameras of one reconstruction, step by step, in a
// cluster and in one process alike: results are taken from the store, surfaces accepted, cameras chosen, and what is
// lost is made again. Thread-safe; it has no thread of its own, and whoever does the jobs learns of them from the
// store.
class OuterLoop {
 public:
  // `epoch`: of the conductor's lease. Errors are those of Conductor::Open(); that no pair of cameras is feasible is
  // bad input.
  static absl::StatusOr<std::unique_ptr<OuterLoop>> Open(const OuterLoopEnvironment& environment,
                                                         const std::string& reconstruction, int64_t epoch,
                                                         const std::vector<Camera>& cameras,
                                                         const std::vector<SparsePoint>& points,
                                                         const ReconstructionConfig& config);

  // Repairs a blob that is none of its surfaces: whether it is there again. NotFound: it is none of this
  // reconstruction.
  using RepairOther = std::function<absl::StatusOr<bool>(const std::string& digest)>;
  void SetRepairOther(RepairOther repair) { repair_other_ = std::move(repair); }

  struct Progress {
    bool has_new_jobs = false;                       // in the store
    bool finished = false;                           // all cameras are committed, and no blob is reported as damaged
    absl::Time expected_end = absl::InfinitePast();  // of all of it, mesh included; or nothing can be said
  };
  // Goes as far as it can at the moment. To be called again when there may be something new in the store. Aborted:
  // somebody else conducts it. DataLoss: a blob is damaged or lost and cannot be made again.
  absl::StatusOr<Progress> Step();
  // Whether the blob is there again: a surface is made again by its job or its acceptance and must come out the same.
  // False: its job has to be done first; to be asked again. NotFound: it is none of this reconstruction.
  absl::StatusOr<bool> Repair(const std::string& digest);

  Conductor& conductor() { return *conductor_; }

 private:
  OuterLoop(const OuterLoopEnvironment& environment, std::string reconstruction, int64_t epoch,
            std::unique_ptr<Conductor> conductor);

  absl::StatusOr<bool> RepairLocked(const std::string& digest) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::Status Forecast() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::StatusOr<bool> RepairReported() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::StatusOr<bool> RunAgain(SequenceNumber sequence, const std::string& digest)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const OuterLoopEnvironment environment_;
  const std::string reconstruction_;
  const int64_t epoch_;
  const std::unique_ptr<Conductor> conductor_;
  RepairOther repair_other_;
  Mutex mutex_;  // one step at a time
  EndForecast forecast_ ABSL_GUARDED_BY(mutex_);
  bool has_new_jobs_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace meshwright
