// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "coordinator/store/job_store.h"
#include "coordinator/store/sql_database.h"

namespace meshwright {

// The JobStore over any database that knows the statements of the sql folder. Each method is one statement, or one
// transaction of several; where it changed nothing, what is stored says why.
class SqlJobStore : public JobStore {
 public:
  explicit SqlJobStore(std::unique_ptr<SqlDatabase> database) : database_(std::move(database)) {}

  absl::StatusOr<absl::Time> Now() override { return database_->Now(); }
  absl::Status CreateReconstruction(const Reconstruction& reconstruction, absl::Time now) override;
  absl::StatusOr<Reconstruction> GetReconstruction(const std::string& id) override;
  absl::StatusOr<std::vector<Reconstruction>> ListReconstructions(const std::string& after, int64_t limit) override;
  absl::StatusOr<std::vector<Reconstruction>> ListReconstructionsOf(const std::string& owner, const std::string& after,
                                                                    int64_t limit) override;
  absl::StatusOr<Usage> UsageOf(const std::string& owner) override;
  absl::Status RequestState(const std::string& id, ReconstructionState state, absl::Time now) override;
  absl::Status SetReconstructionScene(const std::string& id, const std::string& scene_digest,
                                      const std::string& scene_blob, int64_t conductor_epoch) override;
  absl::Status SetReconstructionState(const std::string& id, ReconstructionState state, const std::string& reason,
                                      absl::Time now, int64_t conductor_epoch) override;
  absl::Status FinishReconstruction(const std::string& id, const StoredMesh& mesh, absl::Time now,
                                    int64_t conductor_epoch) override;
  absl::Status Advance(const std::string& id, const std::vector<Commit>& commits,
                       const std::vector<CameraAssignment>& assignments, const Progress& progress, absl::Time now,
                       int64_t conductor_epoch) override;
  absl::Status BeginDeletion(const std::string& id) override;
  absl::Status DeleteReconstruction(const std::string& id) override;
  absl::Status ReopenCameraJob(const std::string& id, SequenceNumber sequence, int64_t epoch,
                               const std::string& expected_digest, const std::string& reason, absl::Time retry_at,
                               int64_t conductor_epoch) override;
  absl::StatusOr<CameraJob> GetCameraJob(const std::string& id, SequenceNumber sequence) override;
  absl::StatusOr<std::vector<CameraJob>> ListCameraJobs(const std::string& id, SequenceNumber after) override;
  absl::StatusOr<std::vector<JobResult>> ListResults(const std::string& id, SequenceNumber after) override;
  absl::StatusOr<std::vector<OpenJob>> ListOpenJobs() override;
  absl::StatusOr<std::vector<JobChangeResult>> ApplyChanges(const std::vector<JobChange>& changes,
                                                            const std::vector<WorkerRecord>& heartbeats,
                                                            absl::Time now) override;
  absl::StatusOr<std::vector<Attempt>> ListAttempts(const std::string& id, int64_t limit) override;
  absl::StatusOr<std::vector<Commit>> ListCommits(const std::string& id, SequenceNumber after, int64_t limit) override;
  absl::StatusOr<int64_t> AcquireConductorLease(const std::string& id, const std::string& owner, absl::Time expires_at,
                                                absl::Time lapsed_by) override;
  absl::Status RenewConductorLease(const std::string& id, int64_t epoch, absl::Time expires_at,
                                   absl::Time now) override;
  absl::Status ReleaseConductorLease(const std::string& id, int64_t epoch, absl::Time now) override;
  absl::StatusOr<ConductorLease> GetConductorLease(const std::string& id) override;
  absl::StatusOr<std::vector<ConductedState>> ListConducted() override;
  absl::Status SetWorkerDrained(const std::string& worker, bool drained) override;
  absl::StatusOr<std::vector<WorkerRecord>> ListWorkers() override;
  absl::Status RemoveSilentWorkers(absl::Time before) override;
  absl::Status PutSceneFile(const std::string& id, const SceneFile& file) override;
  absl::StatusOr<std::vector<SceneFile>> ListSceneFiles(const std::string& id) override;
  absl::StatusOr<bool> AddBlobRef(const std::string& id, const std::string& digest) override;
  absl::StatusOr<std::vector<std::string>> MarkBlobsForDeletion(const std::string& id) override;
  absl::Status CreateToken(const AccessToken& token) override;
  absl::StatusOr<AccessToken> GetToken(const std::string& id) override;
  absl::StatusOr<std::vector<AccessToken>> ListTokens() override;
  absl::Status RevokeToken(const std::string& id, absl::Time now) override;
  absl::Status RemoveDeadTokens(absl::Time before) override;
  absl::Status ReportDamagedBlob(const std::string& id, const std::string& digest) override;
  absl::StatusOr<std::vector<std::string>> ListDamagedBlobs(const std::string& id) override;
  absl::Status ForgetDamagedBlob(const std::string& id, const std::string& digest) override;

 private:
  // One part of Advance() alone. Repeating it is OK.
  absl::Status AddCommit(const std::string& id, const Commit& commit, absl::Time now, int64_t conductor_epoch);
  absl::Status AssignCameraJob(const std::string& id, const CameraAssignment& assignment, absl::Time now,
                               int64_t conductor_epoch);
  // Why a state could not be set: OK when it is that already.
  absl::Status ExplainState(const std::string& id, ReconstructionState state);
  // Aborted unless `epoch` is the reconstruction's current one.
  absl::Status CheckConductor(const std::string& id, int64_t epoch);

  const std::unique_ptr<SqlDatabase> database_;
};

absl::StatusOr<CameraJob> ReadCameraJob(const SqlRow& row);
std::string CameraJobName(const std::string& id, SequenceNumber sequence);
absl::StatusOr<ReconstructionState> ReadReconstructionState(const std::string& text);

}  // namespace meshwright
