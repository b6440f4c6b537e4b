// SPDX-License-Identifier: Apache-2.0
#include "worker/agent/agent.h"

#include <algorithm>
#include <exception>
#include <new>
#include <random>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include "common/base/bad_input.h"
#include "common/base/clock.h"
#include "common/base/status_macros.h"
#include "common/base/utf8.h"
#include "common/scene/scene_codec.h"
#include "worker/job_input/run_job.h"

namespace meshwright {
namespace {

constexpr double kWaitTimeoutSeconds = 10;
constexpr double kDrainingWaitTimeoutSeconds = 0.5;
constexpr BackoffOptions kRetry = {.first = absl::Milliseconds(200), .longest = absl::Seconds(5)};
constexpr int64_t kCacheShare = 8;
// Before a worker that cannot reach the blobs takes jobs again.
constexpr BackoffOptions kBlobBackoff = {.first = absl::Seconds(2), .longest = absl::Minutes(2)};

std::string DrawInstance() {
  std::random_device random;
  return absl::StrFormat("%08x%08x", random(), random());
}

LogFields FieldsOf(const v1::JobKey& key) {
  return {{"reconstruction", key.reconstruction_id()},
          {"sequence", static_cast<int64_t>(key.sequence())},
          {"attempt", static_cast<int64_t>(key.epoch())}};
}

// What a failure counts against.
enum class Blame {
  kInfrastructure,  // the network or the store: nothing
  kJob,             // an attempt of the job
  kForGood,         // another attempt would meet the same
};

Blame BlameFor(const absl::Status& status) {
  const bool is_the_jobs = absl::IsInvalidArgument(status) || absl::IsFailedPrecondition(status);
  return is_the_jobs ? Blame::kJob : Blame::kInfrastructure;
}

// What is to be told of a job that `process` does, whatever becomes of it.
v1::HeldJob OutcomeOf(const v1::JobKey& key, const std::function<absl::StatusOr<FinishedJob>()>& process,
                      Blame (*blame_for)(const absl::Status& status)) {
  v1::HeldJob told;
  *told.mutable_key() = key;
  try {
    const absl::StatusOr<FinishedJob> finished = process();
    if (finished.ok()) {
      v1::HeldJob::Finished& result = *told.mutable_finished();
      result.set_filtered_digest(finished->filtered_digest);
      result.mutable_weak_targets()->Add(finished->weak_targets.begin(), finished->weak_targets.end());
      result.set_report_json(finished->report_json);
    } else if (absl::IsCancelled(finished.status())) {
      told.mutable_released();
    } else {
      const Blame blame = blame_for(finished.status());
      v1::HeldJob::Failed& failed = *told.mutable_failed();
      failed.set_reason(ToUtf8(std::string(finished.status().message())));
      failed.set_permanent(blame == Blame::kForGood);
      failed.set_infrastructure(blame == Blame::kInfrastructure);
      failed.set_damaged_blob(LostBlobOf(finished.status()));
    }
  } catch (const std::bad_alloc&) {
    told.mutable_failed()->set_reason("out of memory");
    told.mutable_failed()->set_out_of_memory(true);
  } catch (const std::exception& error) {
    told.mutable_failed()->set_reason(absl::StrCat("cannot be processed: ", error.what()));
  }
  return told;
}

absl::StatusOr<CameraJobSpec> ToSpec(const v1::CameraJob& job, size_t cameras) {
  const auto known = [&](int32_t camera) { return camera >= 0 && static_cast<size_t>(camera) < cameras; };
  CameraJobSpec spec = {.sequence = job.key().sequence(),
                        .camera = job.camera(),
                        .snapshot = job.snapshot(),
                        .epoch = job.key().epoch(),
                        .reduction = job.reduction(),
                        .neighbours = {job.neighbours().begin(), job.neighbours().end()},
                        .targets = {job.targets().begin(), job.targets().end()}};
  for (const v1::AcceptedSurface& surface : job.accepted()) {
    spec.accepted.push_back({.sequence = surface.sequence(),
                             .camera = surface.camera(),
                             .digest = surface.digest(),
                             .patches = surface.patches()});
  }
  if (!known(spec.camera) || !std::all_of(spec.targets.begin(), spec.targets.end(), known) ||
      spec.targets.size() > static_cast<size_t>(kMaxTargets)) {
    return absl::InvalidArgumentError(
        absl::StrCat("job ", spec.sequence, ": its cameras are not the scene's ", cameras));
  }
  return spec;
}

}  // namespace

Agent::Agent(const AgentOptions& options, WorkerChannel& channel, BlobStore& blobs, JobConfigParser parse, AgentJob job,
             Logger log, const Clock& clock)
    : options_(options),
      instance_(DrawInstance()),
      channel_(channel),
      blobs_(blobs),
      job_(std::move(job)),
      log_(std::move(log)),
      clock_(clock),
      contexts_(blobs_, std::move(parse), options.memory_bytes / kCacheShare),
      pool_(options.cores),
      held_last_(clock.Uptime()),
      backoff_(kBlobBackoff) {}

Agent::~Agent() {
  for (auto& [key, held] : held_) held.thread.join();
}

void Agent::Drain() {
  {
    const MutexLock lock(mutex_);
    if (draining_) return;
    draining_ = true;
    drain_until_ = clock_.Uptime() + options_.drain;
  }
  wake_.NotifyAll();
  channel_.Interrupt();
}

v1::SynchronizeRequest Agent::NextRequest() {
  const absl::Duration now = clock_.Uptime();
  v1::SynchronizeRequest request;
  request.set_worker_id(options_.worker_id);
  request.set_instance(instance_);
  request.set_version(options_.version);
  request.set_method_version(static_cast<int32_t>(options_.method_version));
  request.set_memory_bytes(options_.memory_bytes);
  request.set_ran_out_of_memory(options_.ran_out_of_memory);
  request.set_colmap_version(options_.estimator.colmap_version);
  const MutexLock lock(mutex_);
  int lost_cores = 0;
  for (auto& [key, held] : held_) {
    if (held.dropped) {
      ++lost_cores;
      continue;
    }
    if (held.running && now >= drain_until_) {
      held.told.mutable_released();
    } else if (held.running) {
      held.told.mutable_running()->set_seconds(absl::ToDoubleSeconds(now - held.begun));
    }
    *request.add_held() = held.told;
  }
  request.set_cores(std::max(1, options_.cores - lost_cores));
  request.set_draining(draining_ || now < backoff_until_ || lost_cores >= options_.cores);
  const absl::Duration until_idle_exit =
      held_.empty() ? held_last_ + options_.exit_when_idle - now : absl::InfiniteDuration();
  request.set_wait_timeout_seconds(request.draining()
                                       ? kDrainingWaitTimeoutSeconds
                                       : std::clamp(absl::ToDoubleSeconds(until_idle_exit), 0.0, kWaitTimeoutSeconds));
  return request;
}

void Agent::Follow(const v1::SynchronizeResponse& response) {
  std::map<Key, const v1::CameraJob*> wanted;
  for (const v1::CameraJob& job : response.jobs()) {
    wanted[{job.key().reconstruction_id(), job.key().sequence(), job.key().epoch()}] = &job;
  }
  std::vector<std::thread> ended;
  {
    const MutexLock lock(mutex_);
    for (auto it = held_.begin(); it != held_.end();) {
      Held& held = it->second;
      const bool drop = held.dropped || wanted.count(it->first) == 0;
      if (drop && held.running && !held.dropped) {
        held.dropped = true;
        log_.With(FieldsOf(held.told.key())).Warning("job dropped: somebody else has it");
      }
      if (drop && !held.running) {
        ended.push_back(std::move(held.thread));
        it = held_.erase(it);
      } else {
        ++it;
      }
    }
    for (const auto& [key, job] : wanted) {
      if (held_.count(key) > 0 || draining_) continue;
      Held& held = held_[key];
      *held.told.mutable_key() = job->key();
      held.told.mutable_running();
      held.begun = clock_.Uptime();
      held.thread = std::thread([this, key = key, job = *job] { Work(key, job); });
    }
  }
  for (std::thread& thread : ended) thread.join();
}

void Agent::Work(const Key& key, const v1::CameraJob& job) {
  const Logger log = log_.With(FieldsOf(job.key())).With({{"camera", static_cast<int64_t>(job.camera())}});
  log.Info("job begun");
  const Stopwatch stopwatch(clock_);
  v1::HeldJob told = job.refine_cameras()        ? ProcessRefinement(key, job)
                     : job.photographs().empty() ? Process(job)
                                                 : ProcessPhotographs(key, job);
  const double seconds = stopwatch.Seconds();
  if (told.has_failed()) {
    log.Error("job failed", {{"seconds", seconds}, {"error", told.failed().reason()}});
  } else {
    log.Info("job finished", {{"seconds", seconds}});
  }
  {
    const MutexLock lock(mutex_);
    if (told.has_finished()) backoff_.Reset();
    if (told.has_failed() && told.failed().infrastructure()) backoff_until_ = clock_.Uptime() + backoff_.Next();
    Held& held = held_.at(key);
    held.told = std::move(told);
    held.running = false;
  }
  wake_.NotifyAll();
  channel_.Interrupt();
}

bool Agent::TellStep(const Key& key, const std::string& step, double fraction) {
  const MutexLock lock(mutex_);
  Held& held = held_.at(key);
  if (held.told.has_running()) {
    held.told.mutable_running()->set_step(step);
    held.told.mutable_running()->set_fraction(fraction);
  }
  return !held.dropped && clock_.Uptime() < drain_until_;
}

v1::HeldJob Agent::ProcessRefinement(const Key& key, const v1::CameraJob& job) {
  const auto process = [&]() -> absl::StatusOr<FinishedJob> {
    if (options_.refiner == nullptr) return absl::FailedPreconditionError("this worker refines no cameras");
    MW_ASSIGN_OR_RETURN(const std::string bytes, blobs_.Get(job.scene_digest()));
    MW_ASSIGN_OR_RETURN(const Scene scene, DecodeScene(bytes));
    MW_ASSIGN_OR_RETURN(CameraRefinement refinement,
                        options_.refiner(scene, job.options_json(), blobs_, pool_,
                                         [&](double done) { return TellStep(key, "refining", done); }));
    FinishedJob finished;
    MW_ASSIGN_OR_RETURN(finished.filtered_digest, blobs_.Put(EncodeCameraRefinement(refinement)));
    refinement.cam_from_world.clear();
    finished.report_json = EncodeCameraRefinement(refinement);
    return finished;
  };
  return OutcomeOf(job.key(), process, [](const absl::Status& status) {
    return absl::IsFailedPrecondition(status) ? Blame::kForGood : BlameFor(status);
  });
}

v1::HeldJob Agent::ProcessPhotographs(const Key& key, const v1::CameraJob& job) {
  const auto stop = [&] {
    const MutexLock lock(mutex_);
    return held_.at(key).dropped || clock_.Uptime() >= drain_until_;
  };
  const auto progress = [&](const std::string& step, double fraction) { TellStep(key, step, fraction); };
  const auto process = [&]() -> absl::StatusOr<FinishedJob> {
    if (options_.estimator.estimate == nullptr) return absl::FailedPreconditionError("this worker has no COLMAP");
    return EstimateCamerasOf(job, options_.estimator, blobs_, options_.work_folder, options_.cores, stop, progress);
  };
  return OutcomeOf(job.key(), process, [](const absl::Status& status) {
    if (IsBadInput(status) || absl::IsFailedPrecondition(status)) return Blame::kForGood;
    // COLMAP that breaks down counts against the photographs, a folder or a blob that is not to be had does not.
    return absl::IsInternal(status) ? Blame::kJob : Blame::kInfrastructure;
  });
}

v1::HeldJob Agent::Process(const v1::CameraJob& job) {
  const auto process = [&]() -> absl::StatusOr<FinishedJob> {
    MW_ASSIGN_OR_RETURN(const std::shared_ptr<const JobContext> context,
                        contexts_.For(job.scene_digest(), job.options_json(), job.reduction()));
    MW_ASSIGN_OR_RETURN(const CameraJobSpec spec, ToSpec(job, context->cameras.size()));
    const CameraJobFunction function = [&](const CameraJobInput& input, ThreadPool& pool) {
      return job_(input, context->config.job, pool);
    };
    return RunJob(context->scene, spec, *context->inputs, function, blobs_, pool_);
  };
  return OutcomeOf(job.key(), process, BlameFor);
}

absl::Duration Agent::IdleFor() {
  const MutexLock lock(mutex_);
  const absl::Duration now = clock_.Uptime();
  if (!held_.empty()) held_last_ = now;
  return now - held_last_;
}

bool Agent::Finished() {
  const MutexLock lock(mutex_);
  return draining_ && std::all_of(held_.begin(), held_.end(), [](const auto& entry) { return entry.second.dropped; });
}

void Agent::Run() {
  Backoff retry(kRetry);
  while (true) {
    if (IdleFor() >= options_.exit_when_idle) Drain();
    const bool last = Finished();
    const absl::StatusOr<v1::SynchronizeResponse> response = channel_.Synchronize(NextRequest());
    if (response.ok()) {
      Follow(*response);
      retry.Reset();
    }
    if (last) return;
    if (response.ok() || absl::IsCancelled(response.status())) continue;
    log_.Warning("no answer from the coordinator", {{"error", std::string(response.status().message())}});
    MutexLock lock(mutex_);
    if (clock_.Uptime() >= drain_until_) return;
    wake_.WaitFor(lock, absl::ToChronoMilliseconds(retry.Next()));
  }
}

}  // namespace meshwright
