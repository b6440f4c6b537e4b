// Who holds what: leases of camera jobs, conductors of reconstructions, workers.
#include <algorithm>
#include <map>

#include <absl/strings/str_cat.h>
#include <nlohmann/json.hpp>

#include "common/base/status_macros.h"
#include "coordinator/store/sql_job_store.h"

namespace meshwright {

absl::StatusOr<std::vector<CameraLease>> SqlJobStore::RunForLeases(const std::string& statement,
                                                                   const SqlParameters& parameters) {
  MW_ASSIGN_OR_RETURN(const SqlResult result, database_->Run(statement, parameters));
  std::vector<CameraLease> leases;
  leases.reserve(result.rows.size());
  for (const SqlRow& row : result.rows) {
    MW_ASSIGN_OR_RETURN(CameraJob job, ReadCameraJob(row));
    leases.push_back({row.Text(0), std::move(job)});
  }
  return leases;
}

absl::StatusOr<std::vector<CameraLease>> SqlJobStore::LeaseCameraJobs(const LeaseRequest& request) {
  if (request.worker.empty()) return absl::InvalidArgumentError("a lease needs the name of a worker");
  if (request.expires_at <= request.now) return absl::InvalidArgumentError("a lease must expire after now");
  std::map<std::string, int64_t> turns;
  nlohmann::json ids = nlohmann::json::array();
  for (const std::string& id : request.reconstruction_ids) {
    if (turns.emplace(id, ids.size()).second) ids.push_back(id);
  }
  MW_ASSIGN_OR_RETURN(
      std::vector<CameraLease> leases,
      RunForLeases("lease_camera_jobs",
                   {{"worker", request.worker},
                    {"reconstruction_ids", ids.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace)},
                    {"memory_bytes", request.memory_bytes},
                    {"max_jobs", request.max_jobs},
                    {"expires_at", absl::ToUnixMicros(request.expires_at)},
                    {"now", absl::ToUnixMicros(request.now)}}));
  // Databases return changed rows in no particular order.
  const auto order = [&](const CameraLease& lease) {
    const auto turn = turns.find(lease.reconstruction_id);
    return std::tuple(turn == turns.end() ? 0 : turn->second, lease.job.sequence, lease.reconstruction_id);
  };
  std::sort(leases.begin(), leases.end(),
            [&](const CameraLease& a, const CameraLease& b) { return order(a) < order(b); });
  return leases;
}

absl::Status SqlJobStore::RenewLease(const std::string& id, SequenceNumber sequence, int64_t epoch,
                                     const std::string& worker, absl::Time expires_at, absl::Time now) {
  if (expires_at <= now) return absl::InvalidArgumentError("a lease must expire after now");
  MW_ASSIGN_OR_RETURN(const SqlResult result,
                      database_->Run("renew_lease", {{"id", id},
                                                     {"sequence", sequence},
                                                     {"epoch", epoch},
                                                     {"worker", worker},
                                                     {"expires_at", absl::ToUnixMicros(expires_at)}}));
  if (result.changed == 1) return absl::OkStatus();
  MW_RETURN_IF_ERROR(GetFencedCameraJob(id, sequence, epoch).status());
  return absl::AbortedError(
      absl::StrCat(CameraJobName(id, sequence), " is not held by worker ", worker, " any more (epoch ", epoch, ")"));
}

absl::Status SqlJobStore::ExplainGivenBack(const std::string& id, SequenceNumber sequence, int64_t epoch) {
  MW_ASSIGN_OR_RETURN(const CameraJob job, GetFencedCameraJob(id, sequence, epoch));
  if (job.state != CameraJobState::kAssigned) {
    return absl::FailedPreconditionError(absl::StrCat(CameraJobName(id, sequence), " is finished already"));
  }
  if (job.lease_worker.empty()) return absl::OkStatus();
  return absl::AbortedError(absl::StrCat(CameraJobName(id, sequence), " is held by worker ", job.lease_worker,
                                         " until ", absl::FormatTime(job.lease_expires_at, absl::UTCTimeZone())));
}

absl::Status SqlJobStore::ReleaseLease(const std::string& id, SequenceNumber sequence, int64_t epoch,
                                       const std::string& worker, absl::Time) {
  MW_ASSIGN_OR_RETURN(
      const SqlResult result,
      database_->Run("release_lease", {{"id", id}, {"sequence", sequence}, {"epoch", epoch}, {"worker", worker}}));
  return result.changed == 1 ? absl::OkStatus() : ExplainGivenBack(id, sequence, epoch);
}

absl::Status SqlJobStore::FailLease(const std::string& id, SequenceNumber sequence, int64_t epoch,
                                    const std::string& worker, const CameraJobFailure& failure, absl::Time) {
  MW_ASSIGN_OR_RETURN(const SqlResult result,
                      database_->Run("fail_lease", {{"id", id},
                                                    {"sequence", sequence},
                                                    {"epoch", epoch},
                                                    {"worker", worker},
                                                    {"reason", PrintableText(failure.reason)},
                                                    {"out_of_memory", failure.out_of_memory ? 1 : 0},
                                                    {"retry_at", absl::ToUnixMicros(failure.retry_at)}}));
  return result.changed == 1 ? absl::OkStatus() : ExplainGivenBack(id, sequence, epoch);
}

absl::Status SqlJobStore::ExpireLease(const std::string& id, SequenceNumber sequence, int64_t epoch,
                                      const CameraJobFailure& failure, absl::Time now) {
  MW_ASSIGN_OR_RETURN(const SqlResult result,
                      database_->Run("expire_lease", {{"id", id},
                                                      {"sequence", sequence},
                                                      {"epoch", epoch},
                                                      {"reason", PrintableText(failure.reason)},
                                                      {"out_of_memory", failure.out_of_memory ? 1 : 0},
                                                      {"retry_at", absl::ToUnixMicros(failure.retry_at)},
                                                      {"now", absl::ToUnixMicros(now)}}));
  return result.changed == 1 ? absl::OkStatus() : ExplainGivenBack(id, sequence, epoch);
}

absl::StatusOr<std::vector<CameraLease>> SqlJobStore::ListExpiredLeases(absl::Time now) {
  return RunForLeases("list_expired_leases", {{"now", absl::ToUnixMicros(now)}});
}

absl::StatusOr<std::vector<CameraLease>> SqlJobStore::ListLeases(const std::string& worker) {
  return RunForLeases("list_leases", {{"worker", worker}});
}

absl::Status SqlJobStore::CheckConductor(const std::string& id, int64_t epoch) {
  if (epoch == 0) return absl::OkStatus();
  const absl::StatusOr<ConductorLease> lease = GetConductorLease(id);
  if (lease.ok() && lease->epoch == epoch) return absl::OkStatus();
  if (!lease.ok() && !absl::IsNotFound(lease.status())) return lease.status();
  return absl::AbortedError(absl::StrCat("reconstruction ", id, " is conducted by ",
                                         lease.ok() ? lease->owner : std::string("nobody"), " (epoch ",
                                         lease.ok() ? lease->epoch : 0, "); epoch ", epoch, " may not write any more"));
}

absl::StatusOr<int64_t> SqlJobStore::AcquireConductorLease(const std::string& id, const std::string& owner,
                                                           absl::Time expires_at, absl::Time now) {
  if (expires_at <= now) return absl::InvalidArgumentError("a lease must expire after now");
  MW_ASSIGN_OR_RETURN(const SqlResult result,
                      database_->Run("acquire_conductor_lease", {{"id", id},
                                                                 {"owner", owner},
                                                                 {"expires_at", absl::ToUnixMicros(expires_at)},
                                                                 {"now", absl::ToUnixMicros(now)}}));
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

absl::StatusOr<std::vector<std::string>> SqlJobStore::ListUnconductedReconstructions(absl::Time now) {
  MW_ASSIGN_OR_RETURN(const SqlResult result,
                      database_->Run("list_unconducted_reconstructions", {{"now", absl::ToUnixMicros(now)}}));
  std::vector<std::string> ids;
  ids.reserve(result.rows.size());
  for (const SqlRow& row : result.rows) ids.push_back(row.Text(0));
  return ids;
}

absl::Status SqlJobStore::RecordHeartbeat(const std::string& worker, int64_t cores, int64_t memory_bytes,
                                          absl::Time now) {
  return database_
      ->Run("record_heartbeat",
            {{"worker", worker}, {"cores", cores}, {"memory_bytes", memory_bytes}, {"now", absl::ToUnixMicros(now)}})
      .status();
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
                       .drained = row.Integer(4) != 0});
  }
  return workers;
}

absl::Status SqlJobStore::RemoveWorker(const std::string& worker) {
  return database_->Run("remove_worker", {{"worker", worker}}).status();
}

}  // namespace meshwright
