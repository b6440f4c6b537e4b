// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/apply_pass.h"

#include <utility>

#include "common/base/status_macros.h"
#include "common/job/job_spec_codec.h"

namespace meshwright {

absl::StatusOr<AppliedPass> ApplyPass(SchedulingPass& pass, const std::vector<WorkerRecord>& heartbeats,
                                      JobStore& store, absl::Time now) {
  const std::vector<SchedulingPass::Change> decided = pass.changes();
  std::vector<JobChange> changes;
  changes.reserve(decided.size());
  for (const SchedulingPass::Change& one : decided) changes.push_back(one.change);
  MW_ASSIGN_OR_RETURN(std::vector<JobChangeResult> results, store.ApplyChanges(changes, heartbeats, now));

  AppliedPass applied;
  std::vector<JobChange> failures;
  for (size_t i = 0; i < decided.size(); ++i) {
    const JobChange& change = decided[i].change;
    const OpenJob job = pass.jobs()[decided[i].job];
    pass.ApplyOutcome(decided[i], results[i]);
    if (results[i].status.ok() && change.kind == JobChange::Kind::kClaim) {
      applied.claims.push_back({change.id, *std::move(results[i].job)});
    }
    const bool is_result = change.kind == JobChange::Kind::kComplete || change.kind == JobChange::Kind::kSkipped;
    if (is_result && results[i].status.ok()) applied.news.insert(change.id);
    // A result that the store does not take is a failure of the job; or nobody's any more, which the fence tells.
    if (change.kind != JobChange::Kind::kComplete || results[i].status.ok() || job.lease_worker.empty()) continue;
    applied.refusal.Update(results[i].status);
    failures.push_back(pass.FailureOf(
        job, job.is_repair ? "made again, the result is another one" : std::string(results[i].status.message()),
        false));
  }
  if (!failures.empty()) {
    MW_RETURN_IF_ERROR(store.ApplyChanges(failures, {}, now).status());
    for (const JobChange& change : failures) applied.news.insert(change.id);
  }
  for (const auto& [reconstruction, digest] : pass.damaged_blobs()) {
    MW_RETURN_IF_ERROR(store.ReportDamagedBlob(reconstruction, digest));
    applied.news.insert(reconstruction);
  }
  return applied;
}

SchedulingPass::MemorySteps MemoryStepsOf(JobStore& store) {
  return [&store](const OpenJob& job) -> std::vector<int64_t> {
    const absl::StatusOr<CameraJob> stored = store.GetCameraJob(job.reconstruction_id, job.sequence);
    if (!stored.ok()) return {};
    const absl::StatusOr<StoredJobSpec> spec = DecodeJobSpec(stored->spec);
    return spec.ok() ? spec->memory_bytes : std::vector<int64_t>();
  };
}

absl::StatusOr<CameraJobSpec> SpecOf(const CameraJob& job) {
  MW_ASSIGN_OR_RETURN(StoredJobSpec stored, DecodeJobSpec(job.spec));
  return CameraJobSpec{.sequence = job.sequence,
                       .camera = job.camera,
                       .snapshot = job.snapshot,
                       .epoch = job.epoch,
                       .reduction = static_cast<int>(job.reduction),
                       .neighbours = job.neighbours,
                       .targets = std::move(stored.targets),
                       .accepted = std::move(stored.accepted)};
}

}  // namespace meshwright
