// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/scheduling_pass.h"

#include <algorithm>

#include <absl/strings/str_cat.h>

#include "common/blob/blob_store.h"
#include "common/json/parse_json.h"

namespace meshwright {
namespace {

// Renewing costs a write: done when a third of the lease is gone.
constexpr double kRenewBelow = 2.0 / 3.0;
constexpr int kLimitsOfPreparation = 12;

absl::Duration DelayAfter(const RetryOptions& retry, int64_t attempt) {
  const int64_t doublings = std::min<int64_t>(attempt - 1, 20);
  return std::min(retry.backoff * (int64_t{1} << std::max<int64_t>(doublings, 0)), retry.max_backoff);
}

JobChange ChangeOf(JobChange::Kind kind, const OpenJob& job) {
  return {.kind = kind,
          .id = job.reconstruction_id,
          .sequence = job.sequence,
          .epoch = job.epoch,
          .worker = job.lease_worker};
}

}  // namespace

absl::Status LeaseOptions::Validate() const {
  if (lease < absl::Milliseconds(100)) {
    return absl::InvalidArgumentError(absl::StrCat("lease is ", absl::FormatDuration(lease), ", expected >= 0.1 s"));
  }
  if (job_time_limit < lease) {
    return absl::InvalidArgumentError(absl::StrCat("job_time_limit is ", absl::FormatDuration(job_time_limit),
                                                   ", expected at least the lease, ", absl::FormatDuration(lease)));
  }
  return absl::OkStatus();
}

SchedulingPass::SchedulingPass(const LeaseOptions& lease, const RetryOptions& retry, const LeaseWatch& watch,
                               std::vector<OpenJob> open, absl::Time now, MemorySteps memory_steps)
    : lease_(lease),
      retry_(retry),
      watch_(watch),
      now_(now),
      memory_steps_(std::move(memory_steps)),
      jobs_(std::move(open)),
      changed_(jobs_.size(), false) {
  for (size_t i = 0; i < jobs_.size(); ++i) {
    const OpenJob& job = jobs_[i];
    by_name_[{job.reconstruction_id, job.sequence}] = i;
    Share& share = shares_[job.reconstruction_id];
    share.weight = job.weight;
    if (job.lease_worker.empty()) {
      share.waiting.push_back(i);
    } else {
      ++share.leases;
      by_worker_[job.lease_worker].insert(i);
    }
  }
}

void SchedulingPass::Add(size_t job, JobChange change) {
  changed_[job] = true;
  const bool ends = change.kind != JobChange::Kind::kClaim && change.kind != JobChange::Kind::kRenew;
  if (ends && !jobs_[job].lease_worker.empty()) {
    by_worker_[jobs_[job].lease_worker].erase(job);
    --shares_[jobs_[job].reconstruction_id].leases;
  }
  changes_.push_back({.change = std::move(change), .job = job});
}

JobChange SchedulingPass::FailureOf(const OpenJob& job, const std::string& reason, bool out_of_memory) const {
  const int64_t failures = job.failed_attempts + 1;
  JobChange change = ChangeOf(JobChange::Kind::kFail, job);
  change.reason = reason;
  change.out_of_memory = out_of_memory;
  change.retry_at = now_ + DelayAfter(retry_, failures);
  // What was done before is done again until it is there: its camera is committed and cannot be skipped any more.
  if (job.is_repair) return change;
  if (failures >= retry_.max_failures) {
    change.kind = JobChange::Kind::kSkipped;
    return change;
  }
  if (out_of_memory) {
    const std::vector<int64_t> steps = memory_steps_(job);
    const auto next = static_cast<size_t>(job.reduction + 1);
    change.reduce = next < steps.size();
    if (change.reduce) change.memory_bytes = steps[next];
  }
  return change;
}

JobChange SchedulingPass::LossOf(const OpenJob& job, const std::string& reason, bool out_of_memory) const {
  if (out_of_memory) return FailureOf(job, reason, true);
  const int64_t losses = job.losses + 1;
  JobChange change = ChangeOf(JobChange::Kind::kLose, job);
  change.reason = reason;
  change.retry_at = losses == 1 ? now_ : now_ + DelayAfter(retry_, losses - 1);
  if (losses >= retry_.max_losses && !job.is_repair) {
    change.kind = JobChange::Kind::kSkipped;
    change.reason = absl::StrCat("lost ", losses, " workers, the last one: ", reason);
  }
  return change;
}

bool SchedulingPass::ApplyReport(const WorkerReport& report) {
  const std::set<size_t> held_before = by_worker_[report.worker];
  for (const size_t job : held_before) {
    if (jobs_[job].lease_instance == report.instance || changed_[job]) continue;
    Add(job, LossOf(jobs_[job],
                    absl::StrCat("worker ", report.worker,
                                 report.ran_out_of_memory ? " ran out of memory" : " was started anew"),
                    report.ran_out_of_memory));
  }
  bool settled = false;
  for (const HeldJob& held : report.held) {
    ApplyHeldJob(report, held);
    settled = settled || !std::holds_alternative<JobRunning>(held.outcome);
  }
  return settled;
}

void SchedulingPass::ApplyHeldJob(const WorkerReport& report, const HeldJob& held) {
  const auto found = by_name_.find({held.key.reconstruction, held.key.sequence});
  if (found == by_name_.end()) return;
  const size_t index = found->second;
  const OpenJob& job = jobs_[index];
  // Taken already, or somebody else has the job now.
  if (job.epoch != held.key.epoch || changed_[index]) return;
  // The process that had it last, too: it may be late. Nobody brings results of jobs that it was never given.
  if (job.lease_instance != report.instance) return;
  const bool is_leased = job.lease_worker == report.worker;
  if (!is_leased && !job.lease_worker.empty()) return;
  if (const auto* const finished = std::get_if<JobFinished>(&held.outcome)) {
    ApplyFinished(index, is_leased, *finished);
  } else if (!is_leased) {
    return;
  } else if (const auto* const failed = std::get_if<JobFailed>(&held.outcome)) {
    ApplyFailed(index, *failed);
  } else if (std::holds_alternative<JobReleased>(held.outcome)) {
    Add(index, ChangeOf(JobChange::Kind::kRelease, job));
  } else {
    ApplyRunning(index);
  }
}

// Also when the lease ran out and nobody has taken the job over.
void SchedulingPass::ApplyFinished(size_t index, bool is_leased, const JobFinished& finished) {
  const OpenJob& job = jobs_[index];
  const bool is_report = ParseJson(finished.report_json).ok();
  if (!ValidateDigest(finished.filtered_digest).ok() || !is_report) {
    if (!is_leased) return;
    Add(index, FailureOf(job, is_report ? "filtered_digest: no digest" : "report_json: no JSON", false));
    return;
  }
  JobChange change = ChangeOf(JobChange::Kind::kComplete, job);
  change.filtered_digest = finished.filtered_digest;
  change.weak_targets = finished.weak_targets;
  change.report_json = finished.report_json;
  Add(index, std::move(change));
}

void SchedulingPass::ApplyFailed(size_t index, const JobFailed& failed) {
  const OpenJob& job = jobs_[index];
  const bool is_damage = ValidateDigest(failed.damaged_blob).ok();
  if (is_damage) damaged_blobs_.emplace_back(job.reconstruction_id, failed.damaged_blob);
  if (failed.permanent && IsPreparation(job.sequence)) {
    JobChange change = ChangeOf(JobChange::Kind::kSkipped, job);
    change.reason = failed.reason;
    Add(index, std::move(change));
    return;
  }
  Add(index, failed.infrastructure || is_damage ? LossOf(job, failed.reason, false)
                                                : FailureOf(job, failed.reason, failed.out_of_memory));
}

void SchedulingPass::ApplyRunning(size_t index) {
  const OpenJob& job = jobs_[index];
  // One that seems to last longer than any was written before the clock was set back.
  const absl::Duration left = job.lease_expires_at - now_;
  if (left > kRenewBelow * lease_.lease && left <= lease_.lease) return;
  if (watch_.TakesTooLong(job, TimeLimit(job))) return;  // Expire() sees to it
  JobChange change = ChangeOf(JobChange::Kind::kRenew, job);
  change.expires_at = now_ + lease_.lease;
  Add(index, std::move(change));
}

void SchedulingPass::Expire() {
  for (size_t i = 0; i < jobs_.size(); ++i) {
    const OpenJob& job = jobs_[i];
    if (job.lease_worker.empty() || changed_[i]) continue;
    if (watch_.TakesTooLong(job, TimeLimit(job))) {
      Add(i, FailureOf(job, absl::StrCat("took longer than ", absl::FormatDuration(TimeLimit(job))), false));
    } else if (watch_.HasRunOut(job)) {
      JobChange change = LossOf(job, absl::StrCat("worker ", job.lease_worker, " is silent"), false);
      change.only_if_expired_at = job.lease_expires_at;  // not if it has been renewed since
      Add(i, std::move(change));
    }
  }
}

absl::Duration SchedulingPass::TimeLimit(const OpenJob& job) const {
  return IsPreparation(job.sequence) ? kLimitsOfPreparation * lease_.job_time_limit : lease_.job_time_limit;
}

bool SchedulingPass::Fits(const OpenJob& job, const WorkerReport& report, int64_t free_bytes) const {
  if (job.sequence == kCameraEstimation && !report.has_colmap) return false;
  // A pause that seems longer than any was begun before the clock was set back.
  const bool is_ready = job.not_before <= now_ || job.not_before - now_ > retry_.max_backoff;
  return is_ready && job.method_version == report.method_version && job.memory_bytes <= free_bytes;
}

void SchedulingPass::Grant(const WorkerReport& report) {
  if (report.draining) return;
  std::set<size_t>& leases = by_worker_[report.worker];
  int64_t free_bytes = report.memory_bytes;
  for (const size_t job : leases) free_bytes -= jobs_[job].memory_bytes;
  while (static_cast<int>(leases.size()) < report.cores) {
    Share* best = nullptr;
    size_t best_job = 0;
    for (auto& [id, share] : shares_) {
      if (best != nullptr && share.leases / share.weight >= best->leases / best->weight) continue;
      const auto fitting = std::find_if(share.waiting.begin(), share.waiting.end(), [&](size_t job) {
        return !changed_[job] && Fits(jobs_[job], report, free_bytes);
      });
      if (fitting == share.waiting.end()) continue;
      best = &share;
      best_job = *fitting;
    }
    if (best == nullptr) return;
    JobChange change = ChangeOf(JobChange::Kind::kClaim, jobs_[best_job]);
    change.worker = report.worker;
    change.instance = report.instance;
    change.expires_at = now_ + lease_.lease;
    free_bytes -= jobs_[best_job].memory_bytes;
    Add(best_job, std::move(change));
    ++best->leases;
    leases.insert(best_job);
  }
}

void SchedulingPass::ApplyOutcome(const Change& decided, const JobChangeResult& result) {
  OpenJob& job = jobs_[decided.job];
  if (decided.change.kind != JobChange::Kind::kClaim) {
    if (!result.status.ok()) return;
    if (decided.change.kind == JobChange::Kind::kRenew) {
      job.lease_expires_at = decided.change.expires_at;
    } else {
      job.lease_worker.clear();
    }
    return;
  }
  if (result.status.ok()) {
    job.epoch = result.job->epoch;
    job.lease_worker = decided.change.worker;
    job.lease_instance = decided.change.instance;
    job.leased_at = now_;
    job.lease_expires_at = decided.change.expires_at;
  } else {
    by_worker_[decided.change.worker].erase(decided.job);
    --shares_[job.reconstruction_id].leases;
  }
}

std::vector<const OpenJob*> SchedulingPass::HeldBy(const std::string& worker, const std::string& instance) const {
  std::vector<const OpenJob*> held;
  const auto found = by_worker_.find(worker);
  if (found == by_worker_.end()) return held;
  for (const size_t job : found->second) {
    if (jobs_[job].lease_instance == instance) held.push_back(&jobs_[job]);
  }
  return held;
}

absl::Duration SchedulingPass::UntilNextPauseEnds() const {
  absl::Duration first = absl::InfiniteDuration();
  for (size_t i = 0; i < jobs_.size(); ++i) {
    if (!jobs_[i].lease_worker.empty() || jobs_[i].not_before <= now_) continue;
    first = std::min(first, jobs_[i].not_before - now_);
  }
  for (const Change& decided : changes_) {
    if (decided.change.retry_at > now_) first = std::min(first, decided.change.retry_at - now_);
  }
  return first;
}

int SchedulingPass::LeasesIn(const std::string& reconstruction) const {
  const auto found = shares_.find(reconstruction);
  return found == shares_.end() ? 0 : found->second.leases;
}

}  // namespace meshwright
