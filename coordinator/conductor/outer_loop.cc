// SPDX-License-Identifier: Apache-2.0
#include "coordinator/conductor/outer_loop.h"

#include <utility>

#include <absl/strings/str_cat.h>

#include "common/base/bad_input.h"
#include "common/base/status_macros.h"
#include "common/blob/lost_blob.h"

namespace meshwright {
namespace {

// A job is made smaller at most so often; each time its lattice is spaced twice as wide.
constexpr int kMaxReductions = 2;
// A BlobStore that loses what it was given only now ends the loop, not the patience of those who wait.
constexpr int kMaxRepairsInARow = 100;

}  // namespace

OuterLoop::OuterLoop(const OuterLoopEnvironment& environment, std::string reconstruction, int64_t epoch,
                     std::unique_ptr<Conductor> conductor)
    : environment_(environment),
      reconstruction_(std::move(reconstruction)),
      epoch_(epoch),
      conductor_(std::move(conductor)),
      forecast_(reconstruction_, *conductor_, *environment.store, *environment.clock) {}

absl::StatusOr<std::unique_ptr<OuterLoop>> OuterLoop::Open(const OuterLoopEnvironment& environment,
                                                           const std::string& reconstruction, int64_t epoch,
                                                           const std::vector<Camera>& cameras,
                                                           const std::vector<SparsePoint>& points,
                                                           const ReconstructionConfig& config) {
  const auto job_bytes = [cameras, one = config.job_bytes](CameraJobSpec spec) {
    std::vector<int64_t> bytes;
    for (spec.reduction = 0; spec.reduction <= kMaxReductions; ++spec.reduction) {
      bytes.push_back(one(spec, cameras));
    }
    return bytes;
  };
  absl::StatusOr<std::unique_ptr<Conductor>> conductor =
      Conductor::Open(reconstruction, cameras, points, config.conductor, environment.store, environment.blobs,
                      environment.clock, environment.pool, epoch, job_bytes);
  if (absl::IsFailedPrecondition(conductor.status())) return BadInput(conductor.status());
  MW_RETURN_IF_ERROR(conductor.status());
  return std::unique_ptr<OuterLoop>(new OuterLoop(environment, reconstruction, epoch, *std::move(conductor)));
}

absl::StatusOr<OuterLoop::Progress> OuterLoop::Step() {
  const MutexLock lock(mutex_);
  has_new_jobs_ = false;
  for (int repairs = 0;; ++repairs) {
    const absl::StatusOr<bool> written = conductor_->IngestResults(environment_.max_failures);
    const std::string damaged = conductor_->damaged_blob();
    if (written.ok()) {
      has_new_jobs_ = has_new_jobs_ || *written;
      break;
    }
    if (damaged.empty() || repairs == kMaxRepairsInARow) return written.status();
    MW_ASSIGN_OR_RETURN(const bool repaired, RepairLocked(damaged));
    if (!repaired) return Progress{.has_new_jobs = has_new_jobs_};
  }
  MW_ASSIGN_OR_RETURN(const bool nothing_damaged, RepairReported());
  MW_RETURN_IF_ERROR(Forecast());
  return Progress{.has_new_jobs = has_new_jobs_,
                  .finished = nothing_damaged && conductor_->finished(),
                  .expected_end = conductor_->progress().expected_end};
}

// Told at once: the next commit may be long in coming.
absl::Status OuterLoop::Forecast() {
  MW_ASSIGN_OR_RETURN(const absl::Time expected_end, forecast_.ExpectedEnd());
  if (expected_end == conductor_->progress().expected_end) return absl::OkStatus();
  conductor_->SetExpectedEnd(expected_end);
  return environment_.store->Advance(reconstruction_, {}, {}, conductor_->progress(), environment_.clock->Now(),
                                     epoch_);
}

absl::StatusOr<bool> OuterLoop::Repair(const std::string& digest) {
  const MutexLock lock(mutex_);
  return RepairLocked(digest);
}

absl::StatusOr<bool> OuterLoop::RepairReported() {
  MW_ASSIGN_OR_RETURN(const std::vector<std::string> reported, environment_.store->ListDamagedBlobs(reconstruction_));
  bool all_there = true;
  for (const std::string& digest : reported) {
    const absl::Status status = environment_.blobs->Get(digest).status();
    bool is_there = status.ok();
    if (IsBlobLost(status)) {
      const absl::StatusOr<bool> repaired = RepairLocked(digest);
      // Reports come from outside: it may be no blob of this reconstruction.
      if (!repaired.ok() && !absl::IsNotFound(repaired.status())) return repaired.status();
      is_there = !repaired.ok() || *repaired;
    } else if (!status.ok()) {
      return status;
    }
    if (is_there) MW_RETURN_IF_ERROR(environment_.store->ForgetDamagedBlob(reconstruction_, digest));
    all_there = all_there && is_there;
  }
  return all_there;
}

absl::StatusOr<bool> OuterLoop::RepairLocked(const std::string& digest) {
  if (const SequenceNumber job = conductor_->JobOfFiltered(digest); job > 0) return RunAgain(job, digest);
  if (!conductor_->HasAccepted(digest)) {
    if (repair_other_) return repair_other_(digest);
    return absl::NotFoundError(absl::StrCat("blob ", digest, " is none of reconstruction ", reconstruction_));
  }
  for (int repairs = 0;; ++repairs) {
    const absl::Status remade = conductor_->RemakeAccepted(digest);
    if (remade.ok()) return true;
    const std::string also = conductor_->damaged_blob();
    if (also.empty() || repairs == kMaxRepairsInARow) return remade;
    MW_ASSIGN_OR_RETURN(const bool is_there, RunAgain(conductor_->JobOfFiltered(also), also));
    if (!is_there) return false;
  }
}

absl::StatusOr<bool> OuterLoop::RunAgain(SequenceNumber sequence, const std::string& digest) {
  MW_ASSIGN_OR_RETURN(const CameraJob job, environment_.store->GetCameraJob(reconstruction_, sequence));
  if (job.state == CameraJobState::kDone) {
    const absl::Status there = environment_.blobs->Get(digest).status();
    if (there.ok()) return true;
    if (!IsBlobLost(there)) return there;
    MW_RETURN_IF_ERROR(environment_.store->ReopenCameraJob(
        reconstruction_, sequence, job.epoch, digest,
        absl::StrCat("its surface is damaged or lost (blob ", digest, ")"), absl::UnixEpoch(), epoch_));
    has_new_jobs_ = true;
  } else if (job.failed_attempts >= environment_.max_failures) {
    return absl::DataLossError(absl::StrCat("surface ", digest, " of camera ", job.camera,
                                            " is damaged or lost and cannot be made again: ", job.last_failure));
  }
  return false;
}

}  // namespace meshwright
