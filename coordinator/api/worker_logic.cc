#include "coordinator/api/worker_logic.h"

#include <algorithm>
#include <chrono>
#include <set>
#include <utility>

#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"

namespace meshwright {
namespace {

constexpr size_t kMaxIdLength = 128;
constexpr int kMaxCores = 4096;
constexpr double kMaxPatienceSeconds = 60;
// Backoffs end and clients go away without anybody saying so.
constexpr std::chrono::milliseconds kLookAgain(200);

JobKey FromProto(const v1::JobKey& key) { return {key.reconstruction_id(), key.sequence(), key.epoch()}; }

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
  if (request.memory_bytes() < 1) {
    return absl::InvalidArgumentError(absl::StrCat("memory_bytes is ", request.memory_bytes(), ", expected >= 1"));
  }
  if (!(request.patience_seconds() >= 0 && request.patience_seconds() <= kMaxPatienceSeconds)) {
    return absl::InvalidArgumentError(
        absl::StrCat("patience_seconds is ", request.patience_seconds(), ", expected 0..", kMaxPatienceSeconds));
  }
  return absl::OkStatus();
}

void FillJob(const LeaseBook::Lease& lease, const LeasedReconstruction& reconstruction, v1::CameraJob& job) {
  const CameraJobSpec& spec = lease.job.spec;
  job.mutable_key()->set_reconstruction_id(lease.key.reconstruction);
  job.mutable_key()->set_sequence(lease.key.sequence);
  job.mutable_key()->set_epoch(lease.key.epoch);
  job.set_camera(spec.camera);
  job.set_snapshot(spec.snapshot);
  for (const CameraIndex neighbour : spec.neighbours) job.add_neighbours(neighbour);
  for (const CameraIndex target : spec.targets) job.add_targets(target);
  for (const AcceptedSurface& accepted : spec.accepted) {
    v1::AcceptedSurface& surface = *job.add_accepted();
    surface.set_sequence(accepted.sequence);
    surface.set_camera(accepted.camera);
    surface.set_digest(accepted.digest);
    surface.set_patches(accepted.patches);
  }
  job.set_options_json(reconstruction.options_json);
  job.set_scene_digest(reconstruction.scene_digest);
  job.set_memory_bytes(lease.job.memory_bytes);
}

}  // namespace

WorkerLogic::WorkerLogic(const LeaseOptions& options, const Clock& clock)
    : options_(options), clock_(clock), book_(options) {}

void WorkerLogic::AddReconstruction(const std::string& id, LeasedReconstruction reconstruction) {
  const std::lock_guard<std::mutex> lock(mutex_);
  book_.AddReconstruction(id, reconstruction.weight);
  reconstructions_[id] = std::move(reconstruction);
}

void WorkerLogic::RemoveReconstruction(const std::string& id) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    book_.RemoveReconstruction(id);
    reconstructions_.erase(id);
  }
  changed_.notify_all();
}

void WorkerLogic::Offer(const std::string& id, CameraJobSpec spec, int64_t memory_bytes, absl::Time not_before) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    book_.Offer(id, {.spec = std::move(spec), .memory_bytes = memory_bytes}, not_before);
  }
  changed_.notify_all();
}

int WorkerLogic::LeasesIn(const std::string& id) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return book_.LeasesIn(id);
}

void WorkerLogic::Tell(const LeaseBook::Lease& lease, JobOutcome::Kind kind, std::string reason) {
  const auto found = reconstructions_.find(lease.key.reconstruction);
  if (found == reconstructions_.end()) return;
  found->second.sink(
      {.kind = kind, .sequence = lease.key.sequence, .epoch = lease.key.epoch, .reason = std::move(reason)});
}

void WorkerLogic::Settle(const std::string& worker, const v1::HeldJob& held) {
  if (held.outcome_case() == v1::HeldJob::kRunning || held.outcome_case() == v1::HeldJob::OUTCOME_NOT_SET) return;
  const JobKey key = FromProto(held.key());
  if (!book_.End(worker, key)) return;  // taken already, or somebody else has the job now
  JobOutcome outcome = {.sequence = key.sequence, .epoch = key.epoch};
  switch (held.outcome_case()) {
    case v1::HeldJob::kFinished:
      outcome.filtered_digest = held.finished().filtered_digest();
      outcome.weak_targets.assign(held.finished().weak_targets().begin(), held.finished().weak_targets().end());
      outcome.report_json = held.finished().report_json();
      break;
    case v1::HeldJob::kFailed:
      outcome.kind = held.failed().infrastructure() ? JobOutcome::Kind::kLost : JobOutcome::Kind::kFailed;
      outcome.reason = held.failed().reason();
      break;
    default:
      outcome.kind = JobOutcome::Kind::kGivenBack;
      outcome.reason = absl::StrCat("worker ", worker, " gave it back");
      break;
  }
  const auto found = reconstructions_.find(key.reconstruction);
  if (found != reconstructions_.end()) found->second.sink(std::move(outcome));
}

v1::SynchronizeResponse WorkerLogic::Answer(const std::string& worker) const {
  v1::SynchronizeResponse response;
  for (const LeaseBook::Lease* const lease : book_.LeasesOf(worker)) {
    FillJob(*lease, reconstructions_.at(lease->key.reconstruction), *response.add_jobs());
  }
  response.set_lease_seconds(absl::ToDoubleSeconds(options_.lease));
  response.set_call_again_seconds(absl::ToDoubleSeconds(options_.lease / 3));
  return response;
}

absl::StatusOr<v1::SynchronizeResponse> WorkerLogic::Synchronize(const v1::SynchronizeRequest& request,
                                                                 const std::function<bool()>& cancelled) {
  MW_RETURN_IF_ERROR(Validate(request));
  const WorkerCapacity capacity = {.id = request.worker_id(),
                                   .instance = request.instance(),
                                   .version = request.version(),
                                   .cores = request.cores(),
                                   .memory_bytes = request.memory_bytes(),
                                   .draining = request.draining()};
  std::set<JobKey> known;  // running at the worker
  std::unique_lock<std::mutex> lock(mutex_);
  for (const LeaseBook::Lease& lost : book_.Hear(capacity, clock_.Now())) {
    Tell(lost, JobOutcome::Kind::kLost, absl::StrCat("worker ", capacity.id, " was started anew"));
  }
  bool settled = false;
  for (const v1::HeldJob& held : request.held()) {
    if (held.outcome_case() == v1::HeldJob::kRunning) {
      known.insert(FromProto(held.key()));
    } else {
      Settle(capacity.id, held);
      settled = true;  // the worker waits to hear that it was taken
    }
  }
  const auto patience =
      std::chrono::duration<double>(std::min(request.patience_seconds(), absl::ToDoubleSeconds(options_.lease / 3)));
  const auto deadline = std::chrono::steady_clock::now() + patience;
  while (true) {
    book_.Grant(capacity.id, clock_.Now());
    std::set<JobKey> wanted;
    for (const LeaseBook::Lease* const lease : book_.LeasesOf(capacity.id)) wanted.insert(lease->key);
    if (settled || stopping_ || wanted != known || std::chrono::steady_clock::now() >= deadline) break;
    changed_.wait_for(lock, kLookAgain);
    if (cancelled()) return absl::CancelledError("the worker does not wait any more");
    const auto worker = book_.workers().find(capacity.id);
    if (worker == book_.workers().end() || worker->second.capacity.instance != capacity.instance) {
      return absl::AbortedError(absl::StrCat("worker ", capacity.id, " was started anew"));
    }
  }
  return Answer(capacity.id);
}

void WorkerLogic::ExpireLeases() {
  const std::lock_guard<std::mutex> lock(mutex_);
  for (const LeaseBook::Expired& expired : book_.Expire(clock_.Now())) {
    if (expired.too_long) {
      Tell(expired.lease, JobOutcome::Kind::kFailed,
           absl::StrCat("took longer than ", absl::FormatDuration(options_.job_time_limit)));
    } else {
      Tell(expired.lease, JobOutcome::Kind::kLost, absl::StrCat("worker ", expired.lease.worker, " is silent"));
    }
  }
}

v1::ListWorkersResponse WorkerLogic::ListWorkers() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  v1::ListWorkersResponse response;
  for (const auto& [id, entry] : book_.workers()) {
    v1::Worker& worker = *response.add_workers();
    worker.set_id(id);
    worker.set_cores(entry.capacity.cores);
    worker.set_memory_bytes(entry.capacity.memory_bytes);
    worker.set_draining(entry.capacity.draining);
    worker.set_version(entry.capacity.version);
    worker.set_jobs(static_cast<int>(entry.leases.size()));
    const int64_t nanoseconds = absl::ToUnixNanos(entry.last_seen);
    worker.mutable_last_seen()->set_seconds(nanoseconds / 1'000'000'000);
    worker.mutable_last_seen()->set_nanos(static_cast<int32_t>(nanoseconds % 1'000'000'000));
  }
  return response;
}

void WorkerLogic::Shutdown() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
}

}  // namespace meshwright
