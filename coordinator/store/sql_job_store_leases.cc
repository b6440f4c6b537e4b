// SPDX-License-Identifier: Apache-2.0
// Who holds what: leases of camera jobs, conductors of reconstructions, workers.
#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"
#include "coordinator/store/sql_job_store.h"

namespace meshwright {

namespace {

SqlCall CompleteCall(const JobChange& change, absl::Time now) {
  return {"complete_camera_job",
          {{"id", change.id},
           {"sequence", change.sequence},
           {"epoch", change.epoch},
           {"filtered_digest", change.filtered_digest},
           {"weak_targets", JoinCameraIndices(change.weak_targets)},
           {"report_json", change.report_json},
           {"now", absl::ToUnixMicros(now)}}};
}

SqlCall SkipCall(const JobChange& change, absl::Time now) {
  return {"set_camera_job_aside",
          {{"id", change.id},
           {"sequence", change.sequence},
           {"epoch", change.epoch},
           {"reason", PrintableText(change.reason)},
           {"ending", std::string(change.out_of_memory ? "out_of_memory" : "failed")},
           {"now", absl::ToUnixMicros(now)}}};
}

// A statement for each change.
SqlCall ChangeCall(const JobChange& change, absl::Time now) {
  SqlParameters parameters = {{"id", change.id}, {"sequence", change.sequence}, {"epoch", change.epoch}};
  const auto with = [&](const char* statement, const SqlParameters& more) {
    parameters.insert(parameters.end(), more.begin(), more.end());
    return SqlCall{statement, parameters};
  };
  switch (change.kind) {
    case JobChange::Kind::kClaim:
      return with("claim_camera_job", {{"worker", change.worker},
                                       {"instance", change.instance},
                                       {"expires_at", absl::ToUnixMicros(change.expires_at)},
                                       {"now", absl::ToUnixMicros(now)}});
    case JobChange::Kind::kRenew:
      return with("renew_lease", {{"worker", change.worker}, {"expires_at", absl::ToUnixMicros(change.expires_at)}});
    case JobChange::Kind::kComplete:
      return CompleteCall(change, now);
    case JobChange::Kind::kSkipped:
      return SkipCall(change, now);
    case JobChange::Kind::kRelease:
      return with("release_lease", {{"worker", change.worker},
                                    {"retry_at", absl::ToUnixMicros(change.retry_at)},
                                    {"now", absl::ToUnixMicros(now)}});
    case JobChange::Kind::kFail:
      return with("fail_lease", {{"worker", change.worker},
                                 {"out_of_memory", change.out_of_memory ? 1 : 0},
                                 {"reductions", change.reduce ? 1 : 0},
                                 {"memory_bytes", change.memory_bytes},
                                 {"reason", PrintableText(change.reason)},
                                 {"retry_at", absl::ToUnixMicros(change.retry_at)},
                                 {"now", absl::ToUnixMicros(now)}});
    case JobChange::Kind::kLose:
      return with("expire_lease", {{"worker", change.worker},
                                   {"reason", PrintableText(change.reason)},
                                   {"retry_at", absl::ToUnixMicros(change.retry_at)},
                                   {"expired_at", absl::ToUnixMicros(change.only_if_expired_at)},
                                   {"now", absl::ToUnixMicros(now)}});
  }
  return {};
}

absl::StatusOr<JobChangeResult> ReadChange(const JobChange& change, const SqlResult& result) {
  JobChangeResult read;
  if (change.kind == JobChange::Kind::kClaim && !result.rows.empty()) {
    MW_ASSIGN_OR_RETURN(read.job, ReadCameraJob(result.rows.front()));
  } else if (result.changed != 1) {
    read.status =
        absl::AbortedError(absl::StrCat(CameraJobName(change.id, change.sequence), " is not that of epoch ",
                                        change.epoch, ", or not held by worker ", change.worker, ", any more"));
  }
  return read;
}

// Whether the database has failed, and not a value that it does not take.
bool IsOutage(const absl::Status& status) {
  return absl::IsUnavailable(status) || absl::IsResourceExhausted(status) || absl::IsDataLoss(status) ||
         absl::IsPermissionDenied(status);
}

SqlCall HeartbeatCall(const WorkerRecord& worker) {
  return {"record_heartbeat",
          {{"worker", worker.id},
           {"cores", worker.cores},
           {"memory_bytes", worker.memory_bytes},
           {"now", absl::ToUnixMicros(worker.last_heartbeat)},
           {"instance", worker.instance},
           {"version", worker.version},
           {"draining", worker.draining ? 1 : 0},
           {"method_version", worker.method_version},
           {"colmap_version", worker.colmap_version},
           {"owner", worker.owner}}};
}

}  // namespace

absl::StatusOr<std::vector<OpenJob>> SqlJobStore::ListOpenJobs() {
  MW_ASSIGN_OR_RETURN(const SqlResult result, database_->Run("list_open_jobs", {}));
  std::vector<OpenJob> jobs;
  jobs.reserve(result.rows.size());
  for (const SqlRow& row : result.rows) {
    jobs.push_back({.reconstruction_id = row.Text(0),
                    .weight = static_cast<double>(row.Integer(13)) / 1000,
                    .sequence = static_cast<SequenceNumber>(row.Integer(1)),
                    .camera = static_cast<CameraIndex>(row.Integer(2)),
                    .epoch = row.Integer(3),
                    .memory_bytes = row.Integer(4),
                    .failed_attempts = row.Integer(5),
                    .losses = row.Integer(6),
                    .reduction = row.Integer(7),
                    .is_repair = row.Integer(14) != 0,
                    .method_version = row.Integer(15),
                    .not_before = row.Time(8),
                    .lease_worker = row.Text(9),
                    .lease_instance = row.Text(10),
                    .leased_at = row.Time(11),
                    .lease_expires_at = row.Time(12)});
  }
  return jobs;
}

absl::StatusOr<std::vector<JobChangeResult>> SqlJobStore::ApplyChanges(const std::vector<JobChange>& changes,
                                                                       const std::vector<WorkerRecord>& heartbeats,
                                                                       absl::Time now) {
  std::vector<JobChangeResult> results;
  if (changes.empty() && heartbeats.empty()) return results;
  std::vector<SqlCall> calls;
  calls.reserve(changes.size() + heartbeats.size());
  for (const JobChange& change : changes) calls.push_back(ChangeCall(change, now));
  for (const WorkerRecord& worker : heartbeats) calls.push_back(HeartbeatCall(worker));
  const absl::StatusOr<std::vector<SqlResult>> together = database_->RunAll(calls);
  if (together.ok()) {
    for (size_t i = 0; i < changes.size(); ++i) {
      MW_ASSIGN_OR_RETURN(JobChangeResult read, ReadChange(changes[i], (*together)[i]));
      results.push_back(std::move(read));
    }
    return results;
  }
  if (IsOutage(together.status())) return together.status();
  // One of them cannot be stored: the others shall not suffer for it.
  for (size_t i = 0; i < calls.size(); ++i) {
    const absl::StatusOr<SqlResult> alone = database_->Run(calls[i].statement, calls[i].parameters);
    if (i >= changes.size()) continue;
    if (IsOutage(alone.status())) return alone.status();
    JobChangeResult& result = results.emplace_back();
    if (!alone.ok()) {
      result.status = alone.status();
      continue;
    }
    MW_ASSIGN_OR_RETURN(result, ReadChange(changes[i], *alone));
  }
  return results;
}

absl::StatusOr<std::vector<Attempt>> SqlJobStore::ListAttempts(const std::string& id, int64_t limit) {
  MW_ASSIGN_OR_RETURN(const SqlResult result, database_->Run("list_attempts", {{"id", id}, {"limit", limit}}));
  std::vector<Attempt> attempts;
  attempts.reserve(result.rows.size());
  for (const SqlRow& row : result.rows) {
    attempts.push_back({.sequence = static_cast<SequenceNumber>(row.Integer(0)),
                        .camera = static_cast<CameraIndex>(row.Integer(1)),
                        .epoch = row.Integer(2),
                        .worker = row.Text(3),
                        .began_at = row.Time(4),
                        .ended_at = row.Time(5),
                        // Rows keep the word of the first schema.
                        .ending = row.Text(6) == "given_back" ? "released" : row.Text(6),
                        .reason = row.Text(7)});
  }
  return attempts;
}

absl::Status SqlJobStore::CheckConductor(const std::string& id, int64_t epoch) {
  const absl::StatusOr<ConductorLease> lease = GetConductorLease(id);
  if (lease.ok() && lease->epoch == epoch) return absl::OkStatus();
  if (!lease.ok() && !absl::IsNotFound(lease.status())) return lease.status();
  return absl::AbortedError(absl::StrCat("reconstruction ", id, " is conducted by ",
                                         lease.ok() ? lease->owner : std::string("nobody"), " (epoch ",
                                         lease.ok() ? lease->epoch : 0, "); epoch ", epoch, " may not write any more"));
}

absl::StatusOr<int64_t> SqlJobStore::AcquireConductorLease(const std::string& id, const std::string& owner,
                                                           absl::Time expires_at, absl::Time lapsed_by) {
  MW_ASSIGN_OR_RETURN(const SqlResult result,
                      database_->Run("acquire_conductor_lease", {{"id", id},
                                                                 {"owner", owner},
                                                                 {"expires_at", absl::ToUnixMicros(expires_at)},
                                                                 {"lapsed_by", absl::ToUnixMicros(lapsed_by)}}));
  if (!result.rows.empty()) return result.rows.front().Integer(0);
  MW_RETURN_IF_ERROR(GetReconstruction(id).status());
  return absl::FailedPreconditionError(absl::StrCat("reconstruction ", id, " is conducted by another coordinator"));
}

absl::Status SqlJobStore::RenewConductorLease(const std::string& id, int64_t epoch, absl::Time expires_at,
                                              absl::Time now) {
  if (expires_at <= now) return absl::InvalidArgumentError("a lease must expire after now");
  MW_ASSIGN_OR_RETURN(const SqlResult result,
                      database_->Run("renew_conductor_lease",
                                     {{"id", id}, {"epoch", epoch}, {"expires_at", absl::ToUnixMicros(expires_at)}}));
  if (result.changed == 1) return absl::OkStatus();
  MW_RETURN_IF_ERROR(CheckConductor(id, epoch));
  return absl::AbortedError(absl::StrCat("reconstruction ", id, " has no conductor of epoch ", epoch));
}

absl::Status SqlJobStore::ReleaseConductorLease(const std::string& id, int64_t epoch, absl::Time now) {
  return database_->Run("release_conductor_lease", {{"id", id}, {"epoch", epoch}, {"now", absl::ToUnixMicros(now)}})
      .status();
}

absl::StatusOr<ConductorLease> SqlJobStore::GetConductorLease(const std::string& id) {
  MW_ASSIGN_OR_RETURN(const SqlResult result, database_->Run("get_conductor_lease", {{"id", id}}));
  if (result.rows.empty()) return absl::NotFoundError(absl::StrCat("nobody has conducted reconstruction ", id, " yet"));
  const SqlRow& row = result.rows.front();
  return ConductorLease{.owner = row.Text(0), .epoch = row.Integer(1), .expires_at = row.Time(2)};
}

absl::StatusOr<std::vector<ConductedState>> SqlJobStore::ListConducted() {
  MW_ASSIGN_OR_RETURN(const SqlResult result, database_->Run("list_conducted", {}));
  std::vector<ConductedState> all;
  all.reserve(result.rows.size());
  for (const SqlRow& row : result.rows) {
    MW_ASSIGN_OR_RETURN(const ReconstructionState state, ReadReconstructionState(row.Text(1)));
    all.push_back({.id = row.Text(0),
                   .state = state,
                   .lease = {.owner = row.Text(2), .epoch = row.Integer(3), .expires_at = row.Time(4)},
                   .method_version = row.Integer(5)});
  }
  return all;
}

absl::Status SqlJobStore::SetWorkerDrained(const std::string& worker, bool drained) {
  MW_ASSIGN_OR_RETURN(const SqlResult result,
                      database_->Run("set_worker_drained", {{"worker", worker}, {"drained", drained ? 1 : 0}}));
  return result.changed == 1 ? absl::OkStatus() : absl::NotFoundError(absl::StrCat("no worker ", worker));
}

absl::StatusOr<std::vector<WorkerRecord>> SqlJobStore::ListWorkers() {
  MW_ASSIGN_OR_RETURN(const SqlResult result, database_->Run("list_workers", {}));
  std::vector<WorkerRecord> workers;
  workers.reserve(result.rows.size());
  for (const SqlRow& row : result.rows) {
    workers.push_back({.id = row.Text(0),
                       .cores = row.Integer(1),
                       .memory_bytes = row.Integer(2),
                       .last_heartbeat = row.Time(3),
                       .drained = row.Integer(4) != 0,
                       .instance = row.Text(5),
                       .version = row.Text(6),
                       .draining = row.Integer(7) != 0,
                       .method_version = row.Integer(8),
                       .colmap_version = row.Text(9),
                       .owner = row.Text(10)});
  }
  return workers;
}

absl::Status SqlJobStore::RemoveSilentWorkers(absl::Time before) {
  return database_->Run("remove_silent_workers", {{"before", absl::ToUnixMicros(before)}}).status();
}

}  // namespace meshwright
