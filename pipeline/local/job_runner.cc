// SPDX-License-Identifier: Apache-2.0
#include "pipeline/local/job_runner.h"

#include <chrono>
#include <exception>
#include <limits>
#include <new>
#include <thread>
#include <utility>

#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"
#include "common/blob/lost_blob.h"

namespace meshwright {
namespace {

// The folder's lock keeps a second process out, so there is one worker, the same whenever it is started anew: a job
// that a process had when it was killed is simply run by the next. Nobody can be silent, and no job takes too long.
constexpr char kWorker[] = "local";
constexpr LeaseOptions kLease = {.job_time_limit = absl::InfiniteDuration()};
constexpr RetryOptions kRetry = {.max_losses = std::numeric_limits<int>::max(), .backoff = absl::ZeroDuration()};
// Where there is nothing to do although not all is done: how soon to look again.
constexpr std::chrono::milliseconds kLookAgain(50);

}  // namespace

absl::Status JobRunner::Run(const std::function<void(const CameraJobReport&)>& finished) {
  std::vector<std::thread> workers;
  for (int i = 1; i < settings_.concurrent_jobs; ++i) {
    workers.emplace_back([&] { Work(finished); });
  }
  Work(finished);
  for (std::thread& worker : workers) worker.join();
  const MutexLock lock(mutex_);
  return status_;
}

void JobRunner::Work(const std::function<void(const CameraJobReport&)>& finished) {
  QueuedJob next;
  for (Turn turn = WaitForTurn(next); turn != Turn::kEnd; turn = WaitForTurn(next)) {
    if (turn == Turn::kJob) {
      Process(next, finished);
    } else {
      Step();
    }
    MutexLock lock(mutex_);
    --busy_;
    changed_.NotifyAll();
    const bool nothing_to_do = queue_.empty() && busy_ == 0 && status_.ok() && !ended_;
    if (nothing_to_do) changed_.WaitFor(lock, kLookAgain);
  }
}

JobRunner::Turn JobRunner::WaitForTurn(QueuedJob& next) {
  MutexLock lock(mutex_);
  while (status_.ok() && !ended_ && queue_.empty() && busy_ > 0) changed_.Wait(lock);
  if (!status_.ok() || ended_) return Turn::kEnd;
  ++busy_;
  if (queue_.empty()) return Turn::kLook;  // the beginning; or what is lost is made again
  next = std::move(queue_.front());
  queue_.pop_front();
  return Turn::kJob;
}

absl::StatusOr<FinishedJob> JobRunner::RunOrFail(const CameraJobSpec& spec) {
  try {
    return RunJob(parts_.scene, spec, parts_.inputs, parts_.job, parts_.blobs, parts_.pool);
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError(absl::StrCat("camera ", spec.camera, ": not enough memory"));
  } catch (const std::exception& error) {
    return absl::InternalError(absl::StrCat("camera ", spec.camera, ": ", error.what()));
  }
}

void JobRunner::Process(const QueuedJob& job, const std::function<void(const CameraJobReport&)>& finished) {
  absl::StatusOr<FinishedJob> done = RunOrFail(job.spec);
  const std::string lost = LostBlobOf(done.status());
  {
    const MutexLock lock(mutex_);
    HeldJob& held = held_.at(job.key);
    if (done.ok()) {
      held.outcome = JobFinished{.filtered_digest = std::move(done->filtered_digest),
                                 .weak_targets = std::move(done->weak_targets),
                                 .report_json = std::move(done->report_json)};
    } else if (!lost.empty()) {
      held.outcome = JobFailed{.reason = std::string(done.status().message()), .damaged_blob = lost};
    } else {
      status_.Update(done.status());
    }
    Pass();
  }
  Step();
  const MutexLock lock(mutex_);
  if (done.ok()) finished(done->report);
}

void JobRunner::Step() {
  const absl::StatusOr<OuterLoop::Progress> progress = parts_.loop.Step();
  const MutexLock lock(mutex_);
  status_.Update(progress.status());
  ended_ = ended_ || (progress.ok() && progress->finished);
  if (!ended_) Pass();
}

void JobRunner::Pass() {
  const bool had_nothing = held_.empty();
  status_.Update(PassOnce());
  // The first one came whatever it needs; more of them come by their memory.
  if (had_nothing && !held_.empty()) status_.Update(PassOnce());
  changed_.NotifyAll();
}

WorkerReport JobRunner::Report() const {
  WorkerReport report = {
      .worker = kWorker, .instance = kWorker, .method_version = kMethodVersion, .draining = !status_.ok()};
  for (const auto& [key, held] : held_) report.held.push_back(held);
  // One job may always run.
  report.cores = held_.empty() ? 1 : settings_.concurrent_jobs;
  report.memory_bytes = held_.empty() ? std::numeric_limits<int64_t>::max() : settings_.memory_limit_bytes;
  return report;
}

absl::Status JobRunner::PassOnce() {
  MW_ASSIGN_OR_RETURN(const absl::Time now, parts_.store.Now());
  MW_RETURN_IF_ERROR(parts_.lease.RenewIfDue(now));
  MW_ASSIGN_OR_RETURN(std::vector<OpenJob> open, parts_.store.ListOpenJobs());
  const LeaseWatch watch(kLease);  // nobody can be silent
  SchedulingPass pass(kLease, kRetry, watch, std::move(open), now, MemoryStepsOf(parts_.store));
  const WorkerReport report = Report();
  pass.ApplyReport(report);
  pass.Grant(report);
  MW_ASSIGN_OR_RETURN(AppliedPass applied, ApplyPass(pass, {}, parts_.store, now));
  // Aborted: a surface that was made again is another one, which counts as a failure of its job.
  if (!absl::IsAborted(applied.refusal)) MW_RETURN_IF_ERROR(applied.refusal);
  for (const HeldJob& held : report.held) {
    if (!std::holds_alternative<JobRunning>(held.outcome)) held_.erase(held.key);
  }
  return Enqueue(pass, std::move(applied));
}

absl::Status JobRunner::Enqueue(const SchedulingPass& pass, AppliedPass applied) {
  for (const OpenJob* const given : pass.HeldBy(kWorker, kWorker)) {
    const JobKey key = KeyOf(*given);
    if (held_.count(key) > 0) continue;
    CameraJob job;
    for (AppliedPass::Claim& claim : applied.claims) {
      if (claim.job.sequence == key.sequence) job = std::move(claim.job);
    }
    if (job.spec.empty()) {  // it was given to the process before this one
      MW_ASSIGN_OR_RETURN(job, parts_.store.GetCameraJob(key.reconstruction, key.sequence));
    }
    absl::StatusOr<CameraJobSpec> spec = SpecOf(job);
    if (!spec.ok())
      return absl::DataLossError(absl::StrCat("camera job ", key.sequence, ": ", spec.status().message()));
    held_[key] = {.key = key, .outcome = JobRunning()};
    queue_.push_back({key, *std::move(spec)});
  }
  return absl::OkStatus();
}

}  // namespace meshwright
