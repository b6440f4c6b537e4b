#pragma once

#include <memory>
#include <string>
#include <vector>

#include "coordinator/store/job_store.h"
#include "coordinator/store/sql_database.h"

namespace meshwright {

// The JobStore over any database that knows the statements of the sql folder. Each method is one statement, so one
// transaction; where it changed nothing, what is stored says why.
class SqlJobStore : public JobStore {
 public:
  explicit SqlJobStore(std::unique_ptr<SqlDatabase> database) : database_(std::move(database)) {}

  absl::StatusOr<absl::Time> Now() override { return database_->Now(); }

  absl::Status CreateReconstruction(const Reconstruction& reconstruction, absl::Time now) override;
  absl::StatusOr<Reconstruction> GetReconstruction(const std::string& id) override;
  absl::StatusOr<std::vector<Reconstruction>> ListReconstructions(const std::string& after, int64_t limit) override;
  absl::Status SetReconstructionScene(const std::string& id, const std::string& scene_digest) override;
  absl::Status SetReconstructionState(const std::string& id, ReconstructionState state, const std::string& reason,
                                      int64_t conductor_epoch) override;
  absl::Status DeleteReconstruction(const std::string& id) override;

  absl::Status AssignCameraJob(const std::string& id, SequenceNumber sequence, CameraIndex camera,
                               SequenceNumber snapshot, absl::Time now, int64_t conductor_epoch,
                               int64_t memory_bytes) override;
  absl::StatusOr<int64_t> ReassignCameraJob(const std::string& id, SequenceNumber sequence, absl::Time now) override;
  absl::Status CompleteCameraJob(const std::string& id, SequenceNumber sequence, int64_t epoch,
                                 const std::string& filtered_digest, const std::vector<CameraIndex>& weak_targets,
                                 const std::string& report_json, absl::Time now) override;
  absl::Status SetCameraJobAside(const std::string& id, SequenceNumber sequence, int64_t epoch,
                                 const std::string& reason, absl::Time now) override;
  absl::StatusOr<CameraJob> GetCameraJob(const std::string& id, SequenceNumber sequence) override;
  absl::StatusOr<std::vector<CameraJob>> ListCameraJobs(const std::string& id, SequenceNumber after) override;

  absl::StatusOr<std::vector<CameraLease>> LeaseCameraJobs(const LeaseRequest& request) override;
  absl::Status RenewLease(const std::string& id, SequenceNumber sequence, int64_t epoch, const std::string& worker,
                          absl::Time expires_at, absl::Time now) override;
  absl::Status ReleaseLease(const std::string& id, SequenceNumber sequence, int64_t epoch, const std::string& worker,
                            absl::Time now) override;
  absl::Status FailLease(const std::string& id, SequenceNumber sequence, int64_t epoch, const std::string& worker,
                         const CameraJobFailure& failure, absl::Time now) override;
  absl::Status ExpireLease(const std::string& id, SequenceNumber sequence, int64_t epoch,
                           const CameraJobFailure& failure, absl::Time now) override;
  absl::StatusOr<std::vector<CameraLease>> ListExpiredLeases(absl::Time now) override;
  absl::StatusOr<std::vector<CameraLease>> ListLeases(const std::string& worker) override;

  absl::Status AddCommit(const std::string& id, const Commit& commit, absl::Time now, int64_t conductor_epoch) override;
  absl::Status Advance(const std::string& id, const std::vector<Commit>& commits,
                       const std::vector<CameraAssignment>& assignments, absl::Time now,
                       int64_t conductor_epoch) override;
  absl::StatusOr<std::vector<Commit>> ListCommits(const std::string& id, SequenceNumber after) override;

  absl::StatusOr<int64_t> AcquireConductorLease(const std::string& id, const std::string& owner, absl::Time expires_at,
                                                absl::Time now) override;
  absl::Status RenewConductorLease(const std::string& id, int64_t epoch, absl::Time expires_at,
                                   absl::Time now) override;
  absl::Status ReleaseConductorLease(const std::string& id, int64_t epoch, absl::Time now) override;
  absl::StatusOr<ConductorLease> GetConductorLease(const std::string& id) override;
  absl::StatusOr<std::vector<std::string>> ListUnconductedReconstructions(absl::Time now) override;

  absl::Status RecordHeartbeat(const std::string& worker, int64_t cores, int64_t memory_bytes, absl::Time now) override;
  absl::Status SetWorkerDrained(const std::string& worker, bool drained) override;
  absl::StatusOr<std::vector<WorkerRecord>> ListWorkers() override;
  absl::Status RemoveWorker(const std::string& worker) override;

 private:
  // Aborted unless `epoch` is the reconstruction's current one, or 0.
  absl::Status CheckConductor(const std::string& id, int64_t epoch);
  // Aborted unless the job's epoch is this one.
  absl::StatusOr<CameraJob> GetFencedCameraJob(const std::string& id, SequenceNumber sequence, int64_t epoch);
  // Why a lease could not be given back: OK when it was already.
  absl::Status ExplainGivenBack(const std::string& id, SequenceNumber sequence, int64_t epoch);
  absl::StatusOr<std::vector<CameraLease>> RunForLeases(const std::string& statement, const SqlParameters& parameters);

  const std::unique_ptr<SqlDatabase> database_;
};

absl::StatusOr<CameraJob> ReadCameraJob(const SqlRow& row);
std::string CameraJobName(const std::string& id, SequenceNumber sequence);

}  // namespace meshwright
