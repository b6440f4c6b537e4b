// SPDX-License-Identifier: Apache-2.0
#include "coordinator/dispatch/worker_service.h"

#include <algorithm>
#include <future>
#include <utility>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include "common/base/status_macros.h"
#include "common/job/job_spec_codec.h"
#include "coordinator/dispatch/proto_times.h"
#include "coordinator/dispatch/public_numbers.h"
#include "coordinator/dispatch/report_from_proto.h"

namespace meshwright {
namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr size_t kMaxIdLength = 128;
constexpr int kMaxCores = 4096;
constexpr int64_t kMaxMemoryBytes = int64_t{1} << 50;
constexpr int kMaxHeldJobs = 2 * kMaxCores;
constexpr size_t kMaxWorkers = 10'000;
constexpr size_t kMaxCalls = 2 * kMaxWorkers;
constexpr double kMaxWaitTimeoutSeconds = 60;
// Leases that run out, and what another coordinator told and was not heard, are found by looking again.
constexpr std::chrono::milliseconds kLookAgain(1000);
constexpr std::chrono::milliseconds kAskWhetherCancelled(100);
constexpr std::chrono::milliseconds kAfterFailure(200);
// Workers are shown for a while after they were heard of last.
constexpr int kLeasesUntilForgotten = 10;
constexpr absl::Duration kLookAtWorkers = absl::Seconds(1);
constexpr size_t kMaxBackgrounds = 1000;

void FillKey(const OpenJob& job, v1::JobKey& key) {
  key.set_reconstruction_id(job.reconstruction_id);
  key.set_sequence(job.sequence);
  key.set_epoch(job.epoch);
}

std::set<JobKey> RunningAt(const WorkerReport& report) {
  std::set<JobKey> running;
  for (const HeldJob& held : report.held) {
    if (std::holds_alternative<JobRunning>(held.outcome)) running.insert(held.key);
  }
  return running;
}

absl::Status Validate(const v1::SynchronizeRequest& request) {
  if (request.worker_id().empty() || request.worker_id().size() > kMaxIdLength) {
    return absl::InvalidArgumentError(
        absl::StrCat("worker_id has ", request.worker_id().size(), " characters, expected 1..", kMaxIdLength));
  }
  if (request.instance().empty() || request.instance().size() > kMaxIdLength) {
    return absl::InvalidArgumentError(
        absl::StrCat("instance has ", request.instance().size(), " characters, expected 1..", kMaxIdLength));
  }
  if (request.cores() < 1 || request.cores() > kMaxCores) {
    return absl::InvalidArgumentError(absl::StrCat("cores is ", request.cores(), ", expected 1..", kMaxCores));
  }
  if (request.memory_bytes() < 1 || request.memory_bytes() > kMaxMemoryBytes) {
    return absl::InvalidArgumentError(
        absl::StrCat("memory_bytes is ", request.memory_bytes(), ", expected 1..", kMaxMemoryBytes));
  }
  if (request.version().size() > kMaxIdLength) {
    return absl::InvalidArgumentError(
        absl::StrCat("version has ", request.version().size(), " characters, expected at most ", kMaxIdLength));
  }
  if (request.held_size() > kMaxHeldJobs) {
    return absl::InvalidArgumentError(
        absl::StrCat("held has ", request.held_size(), " jobs, expected at most ", kMaxHeldJobs));
  }
  if (!(request.wait_timeout_seconds() >= 0 && request.wait_timeout_seconds() <= kMaxWaitTimeoutSeconds)) {
    return absl::InvalidArgumentError(absl::StrCat("wait_timeout_seconds is ", request.wait_timeout_seconds(),
                                                   ", expected 0..", kMaxWaitTimeoutSeconds));
  }
  return absl::OkStatus();
}

// "rack-7", and "rack-7+2" for several workers with one certificate. No host's name has a "+".
absl::Status CheckName(const std::string& worker, const std::vector<std::string>& names) {
  if (names.empty()) return absl::OkStatus();
  for (const std::string& name : names) {
    if (worker == name || absl::StartsWith(worker, name + "+")) return absl::OkStatus();
  }
  return absl::PermissionDeniedError(absl::StrCat("worker_id is \"", worker, "\", the certificate says \"",
                                                  names.front(), "\": expected that, or \"", names.front(),
                                                  "+\" and more"));
}

double Gibibytes(int64_t bytes) { return static_cast<double>(bytes) / static_cast<double>(int64_t{1} << 30); }

// `workers`: by the version of their method.
std::string DescribeNoWorker(int64_t version, const std::map<int64_t, int64_t>& workers) {
  if (workers.empty()) return "cameras wait, and no worker is connected";
  std::vector<std::string> others;
  for (const auto& [other, memory] : workers) others.push_back(other == 0 ? "none told" : absl::StrCat(other));
  return absl::StrCat("cameras wait for a worker with version ", version,
                      " of the method, which this was begun with; connected workers have ",
                      absl::StrJoin(others, ", "));
}

v1::Attempt RunningAttempt(const OpenJob& job) {
  v1::Attempt attempt;
  attempt.set_reconstruction_id(job.reconstruction_id);
  attempt.set_sequence(PublicSequence(job.sequence));
  attempt.set_camera(PublicCamera(job.camera));
  attempt.set_epoch(job.epoch);
  attempt.set_worker(job.lease_worker);
  FillTime(job.leased_at, *attempt.mutable_begin_time());
  return attempt;
}

}  // namespace

WorkerService::WorkerService(const LeaseOptions& lease, const RetryOptions& retry, JobStore& store, const Clock& clock)
    : lease_(lease), retry_(retry), store_(store), clock_(clock), watch_(lease) {
  thread_ = std::thread([this] { Run(); });
}

WorkerService::~WorkerService() {
  Shutdown();
  thread_.join();
}

void WorkerService::Shutdown() {
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
  }
  wake_.NotifyAll();
}

absl::Status WorkerService::Drain(const std::string& worker) {
  const absl::Status drained = store_.SetWorkerDrained(worker, true);
  if (absl::IsNotFound(drained)) {
    return absl::NotFoundError(absl::StrCat("there is no worker \"", worker.substr(0, kMaxIdLength), "\""));
  }
  MW_RETURN_IF_ERROR(drained);
  {
    const MutexLock lock(mutex_);
    workers_changed_ = true;
    awake_ = true;
  }
  wake_.NotifyAll();
  return absl::OkStatus();
}

void WorkerService::Wake() {
  {
    const MutexLock lock(mutex_);
    awake_ = true;
  }
  wake_.NotifyAll();
}

void WorkerService::SetListener(std::function<void(const std::string&)> listener) {
  const MutexLock lock(mutex_);
  listener_ = std::move(listener);
}

int64_t WorkerService::Synchronize(const v1::SynchronizeRequest& request, Answer answer,
                                   const WorkerIdentity& identity) {
  absl::Status status = Validate(request);
  if (status.ok()) status = CheckName(request.worker_id(), identity.names);
  {
    const MutexLock lock(mutex_);
    if (stopping_ && status.ok()) status = absl::UnavailableError("the coordinator is going down");
    if (status.ok() && workers_.size() >= kMaxWorkers && workers_.count(request.worker_id()) == 0) {
      status = absl::ResourceExhaustedError(absl::StrCat("there are ", kMaxWorkers, " workers already"));
    }
    if (status.ok() && calls_.size() >= kMaxCalls) status = absl::ResourceExhaustedError("too many workers wait");
    if (status.ok()) {
      const double wait = std::min(request.wait_timeout_seconds(), absl::ToDoubleSeconds(lease_.lease / 3));
      const auto deadline =
          SteadyClock::now() + std::chrono::duration_cast<SteadyClock::duration>(std::chrono::duration<double>(wait));
      calls_.push_back({.number = next_call_++,
                        .request = request,
                        .report = FromProto(request),
                        .identity = identity,
                        .answer = std::move(answer),
                        .deadline = deadline});
      awake_ = true;
      wake_.NotifyAll();
      return calls_.back().number;
    }
  }
  answer(status);
  return 0;
}

void WorkerService::Abandon(int64_t call) {
  {
    const MutexLock lock(mutex_);
    abandoned_.push_back(call);
    awake_ = true;
  }
  wake_.NotifyAll();
}

absl::StatusOr<v1::SynchronizeResponse> WorkerService::Synchronize(const v1::SynchronizeRequest& request,
                                                                   const std::function<bool()>& cancelled) {
  const auto promise = std::make_shared<std::promise<absl::StatusOr<v1::SynchronizeResponse>>>();
  std::future<absl::StatusOr<v1::SynchronizeResponse>> answer = promise->get_future();
  const int64_t call = Synchronize(request, [promise](absl::StatusOr<v1::SynchronizeResponse> response) {
    promise->set_value(std::move(response));
  });
  while (answer.wait_for(kAskWhetherCancelled) != std::future_status::ready) {
    if (cancelled()) Abandon(call);
  }
  return answer.get();
}

void WorkerService::Run() {
  MutexLock lock(mutex_);
  while (true) {
    auto until = SteadyClock::now() +
                 std::min(kLookAgain, std::chrono::milliseconds(absl::ToInt64Milliseconds(lease_.lease / 5)));
    if (!calls_.empty()) until = std::min(until, next_pause_ends_);
    for (const Call& call : calls_) until = std::min(until, call.deadline);
    while (!awake_ && !stopping_ && SteadyClock::now() < until) wake_.WaitFor(lock, until - SteadyClock::now());
    awake_ = false;
    const bool last = stopping_;
    lock.Unlock();
    AnswerCalls();
    lock.Lock();
    if (last && calls_.empty()) return;
  }
}

void WorkerService::AnswerCalls() {
  std::list<Call> calls;
  std::vector<int64_t> abandoned;
  bool stopping = false;
  {
    const MutexLock lock(mutex_);
    calls.swap(calls_);
    abandoned.swap(abandoned_);
    stopping = stopping_;
  }
  std::map<std::pair<std::string, std::string>, int64_t> newest;
  const auto caller = [](const Call& call) { return std::pair(call.identity.owner, call.request.worker_id()); };
  for (const Call& call : calls) newest[caller(call)] = call.number;
  for (auto call = calls.begin(); call != calls.end();) {
    absl::Status end;
    if (std::find(abandoned.begin(), abandoned.end(), call->number) != abandoned.end()) {
      end = absl::CancelledError("the worker does not wait any more");
    } else if (newest[caller(*call)] != call->number) {
      end = absl::AbortedError(absl::StrCat("worker ", call->request.worker_id(), " has called again"));
    }
    if (end.ok()) {
      if (stopping) call->deadline = SteadyClock::now();
      ++call;
    } else {
      call->answer(end);
      call = calls.erase(call);
    }
  }
  const absl::Status status = MakePass(calls);
  if (!status.ok()) {
    for (auto call = calls.begin(); call != calls.end();) {
      if (call->is_heard && call->deadline > SteadyClock::now()) {
        ++call;
        continue;
      }
      call->answer(status);
      call = calls.erase(call);
    }
    if (!stopping) std::this_thread::sleep_for(kAfterFailure);
  }
  const MutexLock lock(mutex_);
  calls_.splice(calls_.begin(), calls);
}

absl::Status WorkerService::MakePass(std::list<Call>& calls) {
  MW_ASSIGN_OR_RETURN(const absl::Time now, store_.Now());
  MW_ASSIGN_OR_RETURN(std::vector<OpenJob> open, store_.ListOpenJobs());
  MW_RETURN_IF_ERROR(LookAtWorkers(calls, now));
  RefuseImpostors(calls);
  last_pass_ = now;
  watch_.Observe(open, clock_.Uptime());

  SchedulingPass pass(lease_, retry_, watch_, std::move(open), now, MemoryStepsOf(store_));
  for (Call& call : calls) {
    if (!call.is_heard) call.is_settled = pass.ApplyReport(call.report);
    NoteSteps(call.report);
  }
  pass.Expire();
  for (const Call& call : calls) {
    const auto worker = written_workers_.find(call.report.worker);
    if (worker == written_workers_.end() || !worker->second.drained) pass.Grant(call.report);
  }
  const std::vector<WorkerRecord> heartbeats = Heartbeats(calls, now);
  MW_ASSIGN_OR_RETURN(AppliedPass applied, ApplyPass(pass, heartbeats, store_, now));
  watch_.Observe(pass.jobs(), clock_.Uptime());
  for (const WorkerRecord& worker : heartbeats) written_workers_[worker.id] = worker;
  for (AppliedPass::Claim& claim : applied.claims) {
    claimed_[{claim.reconstruction, claim.job.sequence}] = std::move(claim.job);
  }
  Tell(applied.news);
  Publish(pass, now);
  next_pause_ends_ =
      SteadyClock::now() + absl::ToChronoNanoseconds(std::min(pass.UntilNextPauseEnds(), retry_.max_backoff));

  for (auto call = calls.begin(); call != calls.end();) {
    call->is_heard = true;
    const std::vector<const OpenJob*> held = pass.HeldBy(call->report.worker, call->report.instance);
    std::set<JobKey> wanted;
    for (const OpenJob* const job : held) wanted.insert(KeyOf(*job));
    if (!call->is_settled && wanted == RunningAt(call->report) && call->deadline > SteadyClock::now()) {
      ++call;
      continue;
    }
    call->answer(AnswerTo(*call, held));
    call = calls.erase(call);
  }
  return absl::OkStatus();
}

void WorkerService::Tell(const std::set<std::string>& news) {
  std::function<void(const std::string&)> listener;
  {
    const MutexLock lock(mutex_);
    listener = listener_;
  }
  if (!listener) return;
  for (const std::string& reconstruction : news) listener(reconstruction);
}

std::vector<WorkerRecord> WorkerService::Heartbeats(const std::list<Call>& calls, absl::Time now) {
  std::vector<WorkerRecord> heartbeats;
  for (const Call& call : calls) {
    const v1::SynchronizeRequest& request = call.request;
    const WorkerRecord& before = written_workers_[request.worker_id()];
    const WorkerRecord heard = {.id = request.worker_id(),
                                .cores = request.cores(),
                                .memory_bytes = request.memory_bytes(),
                                .last_heartbeat = now,
                                .drained = before.drained && before.instance == request.instance(),
                                .instance = request.instance(),
                                .version = request.version(),
                                .draining = request.draining(),
                                .method_version = request.method_version(),
                                .colmap_version = request.colmap_version(),
                                .owner = call.identity.owner};
    const bool is_same = before.cores == heard.cores && before.memory_bytes == heard.memory_bytes &&
                         before.instance == heard.instance && before.version == heard.version &&
                         before.draining == heard.draining && before.method_version == heard.method_version &&
                         before.colmap_version == heard.colmap_version && before.owner == heard.owner;
    // One that is still to come was written before the clock was set back.
    const absl::Duration age = now - before.last_heartbeat;
    if (!is_same || age > lease_.lease / 4 || age < absl::ZeroDuration()) heartbeats.push_back(heard);
  }
  return heartbeats;
}

// A name that is new here may have come to another coordinator just now, from somebody else.
absl::Status WorkerService::LookAtWorkers(const std::list<Call>& calls, absl::Time now) {
  const bool has_new_owner = std::any_of(calls.begin(), calls.end(), [&](const Call& call) {
    const auto known = written_workers_.find(call.request.worker_id());
    return !call.is_heard && !call.identity.owner.empty() &&
           (known == written_workers_.end() || known->second.owner != call.identity.owner);
  });
  {
    const MutexLock lock(mutex_);
    const absl::Duration age = now - last_look_at_workers_;
    const bool is_due = age >= std::min(lease_.lease / 4, kLookAtWorkers) || age < absl::ZeroDuration();
    if (!is_due && !workers_changed_ && !has_new_owner) return absl::OkStatus();
    workers_changed_ = false;
  }
  // Not when the clock has just jumped, or nobody could be heard.
  if (now - last_pass_ < lease_.lease) {
    MW_RETURN_IF_ERROR(store_.RemoveSilentWorkers(now - kLeasesUntilForgotten * lease_.lease));
  }
  MW_ASSIGN_OR_RETURN(const std::vector<WorkerRecord> workers, store_.ListWorkers());
  last_look_at_workers_ = now;
  written_workers_.clear();
  for (const WorkerRecord& worker : workers) written_workers_[worker.id] = worker;
  return absl::OkStatus();
}

// What a worker holds is lost when its process is another one, so that a name is worth something: it is the owner's who
// came with it first, or whose certificate says so.
void WorkerService::RefuseImpostors(std::list<Call>& calls) const {
  std::map<std::string, std::string> owners;
  for (auto call = calls.begin(); call != calls.end();) {
    const std::string& id = call->request.worker_id();
    const std::string& owner = call->identity.owner;
    const auto known = written_workers_.find(id);
    const bool is_taken = call->identity.names.empty() && known != written_workers_.end() &&
                          !known->second.owner.empty() && known->second.owner != owner;
    if (owner.empty() || (!is_taken && owners.try_emplace(id, owner).first->second == owner)) {
      ++call;
      continue;
    }
    call->answer(absl::PermissionDeniedError(
        absl::StrCat("worker_id is \"", id, "\", which a worker with another key has: choose another --worker-id")));
    call = calls.erase(call);
  }
}

absl::StatusOr<WorkerService::Background> WorkerService::BackgroundOf(const std::string& reconstruction) {
  const auto found = backgrounds_.find(reconstruction);
  if (found != backgrounds_.end()) return found->second;
  MW_ASSIGN_OR_RETURN(const Reconstruction stored, store_.GetReconstruction(reconstruction));
  if (backgrounds_.size() >= kMaxBackgrounds) backgrounds_.clear();
  return backgrounds_[reconstruction] = {.options_json = stored.options_json, .scene_blob = stored.scene_blob};
}

absl::StatusOr<v1::CameraJob> WorkerService::EstimationJob(const OpenJob& job, const CameraJob& stored) {
  MW_ASSIGN_OR_RETURN(const std::vector<StoredPhotograph> photographs, DecodePhotographs(stored.spec));
  v1::CameraJob full;
  FillKey(job, *full.mutable_key());
  full.set_memory_bytes(job.memory_bytes);
  for (const StoredPhotograph& photograph : photographs) {
    v1::Photograph& added = *full.add_photographs();
    added.set_path(photograph.path);
    added.set_digest(photograph.digest);
  }
  return full;
}

absl::StatusOr<v1::CameraJob> WorkerService::RefinementJob(const OpenJob& job, const CameraJob& stored) {
  MW_ASSIGN_OR_RETURN(const Reconstruction reconstruction, store_.GetReconstruction(job.reconstruction_id));
  v1::CameraJob full;
  FillKey(job, *full.mutable_key());
  full.set_refine_cameras(true);
  full.set_options_json(reconstruction.options_json);
  full.set_scene_digest(stored.spec);
  full.set_memory_bytes(job.memory_bytes);
  return full;
}

absl::StatusOr<v1::CameraJob> WorkerService::FullJob(const OpenJob& job) {
  CameraJob& stored = claimed_[{job.reconstruction_id, job.sequence}];
  if (stored.spec.empty() || stored.epoch != job.epoch) {
    // Claimed by another coordinator, or by this one before it was started anew.
    MW_ASSIGN_OR_RETURN(stored, store_.GetCameraJob(job.reconstruction_id, job.sequence));
  }
  if (job.sequence == kCameraEstimation) return EstimationJob(job, stored);
  if (job.sequence == kCameraRefinement) return RefinementJob(job, stored);
  MW_ASSIGN_OR_RETURN(const CameraJobSpec spec, SpecOf(stored));
  MW_ASSIGN_OR_RETURN(const Background background, BackgroundOf(job.reconstruction_id));
  v1::CameraJob full;
  FillKey(job, *full.mutable_key());
  full.set_camera(spec.camera);
  full.set_snapshot(spec.snapshot);
  full.mutable_neighbours()->Add(spec.neighbours.begin(), spec.neighbours.end());
  full.mutable_targets()->Add(spec.targets.begin(), spec.targets.end());
  for (const AcceptedSurface& accepted : spec.accepted) {
    v1::AcceptedSurface& surface = *full.add_accepted();
    surface.set_sequence(accepted.sequence);
    surface.set_camera(accepted.camera);
    surface.set_digest(accepted.digest);
    surface.set_patches(accepted.patches);
  }
  full.set_options_json(background.options_json);
  full.set_scene_digest(background.scene_blob);
  full.set_memory_bytes(job.memory_bytes);
  full.set_reduction(static_cast<int32_t>(job.reduction));
  return full;
}

absl::StatusOr<v1::SynchronizeResponse> WorkerService::AnswerTo(const Call& call,
                                                                const std::vector<const OpenJob*>& held) {
  const std::set<JobKey> known = RunningAt(call.report);
  v1::SynchronizeResponse response;
  for (const OpenJob* const job : held) {
    if (known.count(KeyOf(*job)) > 0) {
      FillKey(*job, *response.add_jobs()->mutable_key());
    } else {
      MW_ASSIGN_OR_RETURN(*response.add_jobs(), FullJob(*job));
    }
  }
  response.set_lease_seconds(absl::ToDoubleSeconds(lease_.lease));
  response.set_next_sync_seconds(absl::ToDoubleSeconds(lease_.lease / 3));
  return response;
}

void WorkerService::Publish(const SchedulingPass& pass, absl::Time now) {
  std::set<std::pair<std::string, SequenceNumber>> leased;
  for (const OpenJob& job : pass.jobs()) {
    if (!job.lease_worker.empty()) leased.insert({job.reconstruction_id, job.sequence});
  }
  for (auto it = claimed_.begin(); it != claimed_.end();) {
    it = leased.count(it->first) > 0 ? std::next(it) : claimed_.erase(it);
  }
  const MutexLock lock(mutex_);
  for (auto it = steps_.begin(); it != steps_.end();) {
    const bool is_prepared_here =
        leased.count({it->first, kCameraEstimation}) > 0 || leased.count({it->first, kCameraRefinement}) > 0;
    it = is_prepared_here ? std::next(it) : steps_.erase(it);
  }
  seen_ = pass.jobs();
  workers_ = written_workers_;
  seen_at_ = now;
}

void WorkerService::NoteSteps(const WorkerReport& report) {
  const MutexLock lock(mutex_);
  for (const HeldJob& held : report.held) {
    const auto* const running = std::get_if<JobRunning>(&held.outcome);
    if (running != nullptr && !running->step.empty()) steps_[held.key.reconstruction] = *running;
  }
}

std::string WorkerService::StageOf(const std::string& reconstruction) const {
  const MutexLock lock(mutex_);
  for (const OpenJob& job : seen_) {
    if (job.reconstruction_id != reconstruction || !IsPreparation(job.sequence)) continue;
    if (job.lease_worker.empty()) {
      const bool needs_colmap = job.sequence == kCameraEstimation;
      return !needs_colmap || HasWorkerWithColmap(job.method_version) ? "cameras: waiting for a worker"
                                                                      : "cameras: waiting for a worker with COLMAP";
    }
    const auto step = steps_.find(reconstruction);
    if (step == steps_.end()) return absl::StrCat("cameras: worker ", job.lease_worker, " begins");
    return absl::StrFormat("cameras: %s, %.0f %%", step->second.step, 100 * step->second.fraction);
  }
  return "";
}

bool WorkerService::IsAlive(const WorkerRecord& worker) const {
  return absl::AbsDuration(seen_at_ - worker.last_heartbeat) <= lease_.lease && !worker.draining && !worker.drained;
}

bool WorkerService::HasWorkerWithColmap(int64_t method_version) const {
  for (const auto& [id, worker] : workers_) {
    if (IsAlive(worker) && worker.method_version == method_version && !worker.colmap_version.empty()) return true;
  }
  return false;
}

int WorkerService::LeasesIn(const std::string& reconstruction) const {
  const MutexLock lock(mutex_);
  return static_cast<int>(std::count_if(seen_.begin(), seen_.end(), [&](const OpenJob& job) {
    return job.reconstruction_id == reconstruction && !job.lease_worker.empty();
  }));
}

std::vector<std::string> WorkerService::WarningsFor(const std::string& reconstruction) const {
  const MutexLock lock(mutex_);
  std::map<int64_t, int64_t> largest;  // method version -> memory of the largest worker that takes jobs
  for (const auto& [id, worker] : workers_) {
    if (IsAlive(worker)) largest[worker.method_version] = std::max(largest[worker.method_version], worker.memory_bytes);
  }
  std::vector<std::string> warnings;
  std::set<int64_t> without_worker;
  for (const OpenJob& job : seen_) {
    if (job.reconstruction_id != reconstruction || !job.lease_worker.empty()) continue;
    const auto fitting = largest.find(job.method_version);
    if (fitting == largest.end()) {
      without_worker.insert(job.method_version);
    } else if (job.sequence == kCameraEstimation) {
      if (!HasWorkerWithColmap(job.method_version)) {
        warnings.emplace_back(
            "no worker can estimate the photographs' cameras: start one where COLMAP is installed (apt-get install "
            "colmap), or submit the photographs with their cameras");
      }
    } else if (job.sequence == kCameraRefinement && job.memory_bytes > fitting->second) {
      warnings.push_back(absl::StrFormat("refining cameras needs %.1f GiB of memory, the largest worker has %.1f GiB",
                                         Gibibytes(job.memory_bytes), Gibibytes(fitting->second)));
    } else if (job.memory_bytes > fitting->second) {
      warnings.push_back(absl::StrFormat(
          "camera %d needs %.1f GiB of memory, the largest worker has %.1f GiB: start a worker with more", job.camera,
          Gibibytes(job.memory_bytes), Gibibytes(fitting->second)));
    }
  }
  for (const int64_t version : without_worker) warnings.push_back(DescribeNoWorker(version, largest));
  return warnings;
}

std::vector<v1::Attempt> WorkerService::RunningIn(const std::string& reconstruction) const {
  const MutexLock lock(mutex_);
  std::vector<v1::Attempt> attempts;
  for (const OpenJob& job : seen_) {
    if (job.lease_worker.empty() || (!reconstruction.empty() && job.reconstruction_id != reconstruction)) continue;
    attempts.push_back(RunningAttempt(job));
  }
  return attempts;
}

v1::ListWorkersResponse WorkerService::ListWorkers() const {
  std::map<std::string, WorkerRecord> workers;
  {
    const MutexLock lock(mutex_);
    workers = workers_;
  }
  v1::ListWorkersResponse response;
  std::map<std::string, v1::Worker*> by_id;
  for (const auto& [id, record] : workers) {
    v1::Worker& worker = *response.add_workers();
    worker.set_id(record.id);
    worker.set_cores(static_cast<int32_t>(record.cores));
    worker.set_memory_bytes(record.memory_bytes);
    worker.set_draining(record.draining || record.drained);
    worker.set_version(record.version);
    worker.set_method_version(static_cast<int32_t>(record.method_version));
    worker.set_colmap_version(record.colmap_version);
    FillTime(record.last_heartbeat, *worker.mutable_last_seen());
    by_id[record.id] = &worker;
  }
  for (v1::Attempt& attempt : RunningIn("")) {
    const auto worker = by_id.find(attempt.worker());
    if (worker == by_id.end()) continue;
    worker->second->set_jobs(worker->second->jobs() + 1);
    *worker->second->add_running() = std::move(attempt);
  }
  return response;
}

}  // namespace meshwright
