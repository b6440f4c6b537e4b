#include "coordinator/store/sql_job_store.h"

#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"

namespace meshwright {
namespace {

constexpr std::pair<ReconstructionState, const char*> kStateTexts[] = {{ReconstructionState::kCreated, "created"},
                                                                       {ReconstructionState::kRunning, "running"},
                                                                       {ReconstructionState::kDone, "done"},
                                                                       {ReconstructionState::kCancelled, "cancelled"},
                                                                       {ReconstructionState::kFailed, "failed"}};

std::string StateText(ReconstructionState wanted) {
  for (const auto& [state, text] : kStateTexts) {
    if (state == wanted) return text;
  }
  return "";
}

absl::StatusOr<Reconstruction> ReadReconstruction(const SqlRow& row) {
  for (const auto& [state, text] : kStateTexts) {
    if (row.Text(3) != text) continue;
    return Reconstruction{.id = row.Text(0),
                          .options_json = row.Text(1),
                          .scene_digest = row.Text(2),
                          .state = state,
                          .state_reason = row.Text(4),
                          .weight = row.Integer(5)};
  }
  return absl::DataLossError(absl::StrCat("reconstruction ", row.Text(0), " has the unknown state ", row.Text(3)));
}

Commit ReadCommit(const SqlRow& row) {
  return {.sequence = static_cast<SequenceNumber>(row.Integer(0)),
          .camera = static_cast<CameraIndex>(row.Integer(1)),
          .accepted_digest = row.Text(2),
          .filtered_patches = row.Integer(3),
          .accepted_patches = row.Integer(4)};
}

absl::Status NoReconstruction(const std::string& id) {
  return absl::NotFoundError(absl::StrCat("no reconstruction ", id));
}

SqlCall AssignCall(const std::string& id, const CameraAssignment& assignment, absl::Time now, int64_t conductor_epoch) {
  return {"assign_camera_job",
          {{"id", id},
           {"sequence", assignment.sequence},
           {"camera", assignment.camera},
           {"snapshot", assignment.snapshot},
           {"now", absl::ToUnixMicros(now)},
           {"memory_bytes", assignment.memory_bytes},
           {"conductor_epoch", conductor_epoch}}};
}

SqlCall CommitCall(const std::string& id, const Commit& commit, absl::Time now, int64_t conductor_epoch) {
  return {"add_commit",
          {{"id", id},
           {"sequence", commit.sequence},
           {"camera", commit.camera},
           {"accepted_digest", NullIfEmpty(commit.accepted_digest)},
           {"filtered_patches", commit.filtered_patches},
           {"accepted_patches", commit.accepted_patches},
           {"now", absl::ToUnixMicros(now)},
           {"conductor_epoch", conductor_epoch}}};
}

}  // namespace

std::string CameraJobName(const std::string& id, SequenceNumber sequence) {
  return absl::StrCat("camera job ", sequence, " of reconstruction ", id);
}

absl::StatusOr<CameraJob> ReadCameraJob(const SqlRow& row) {
  CameraJob job;
  job.sequence = static_cast<SequenceNumber>(row.Integer(1));
  job.camera = static_cast<CameraIndex>(row.Integer(2));
  job.snapshot = static_cast<SequenceNumber>(row.Integer(3));
  job.state = row.Text(4) == "done"        ? CameraJobState::kDone
              : row.Text(4) == "set_aside" ? CameraJobState::kSetAside
                                           : CameraJobState::kAssigned;
  job.epoch = row.Integer(5);
  job.filtered_digest = row.Text(6);
  MW_ASSIGN_OR_RETURN(job.weak_targets, SplitCameraIndices(row.Text(7)));
  job.report_json = row.Text(8);
  job.set_aside_reason = row.Text(9);
  job.memory_bytes = row.Integer(10);
  job.failed_attempts = row.Integer(11);
  job.out_of_memory_failures = row.Integer(12);
  job.last_failure = row.Text(13);
  job.not_before = row.Time(14);
  job.lease_worker = row.Text(15);
  job.lease_expires_at = row.Time(16);
  return job;
}

absl::Status SqlJobStore::CreateReconstruction(const Reconstruction& reconstruction, absl::Time now) {
  return database_
      ->Run("create_reconstruction", {{"id", reconstruction.id},
                                      {"options_json", reconstruction.options_json},
                                      {"scene_digest", NullIfEmpty(reconstruction.scene_digest)},
                                      {"state", StateText(reconstruction.state)},
                                      {"now", absl::ToUnixMicros(now)},
                                      {"reason", PrintableText(reconstruction.state_reason)},
                                      {"weight", reconstruction.weight}})
      .status();
}

absl::StatusOr<Reconstruction> SqlJobStore::GetReconstruction(const std::string& id) {
  MW_ASSIGN_OR_RETURN(const SqlResult result, database_->Run("get_reconstruction", {{"id", id}}));
  if (result.rows.empty()) return NoReconstruction(id);
  return ReadReconstruction(result.rows.front());
}

absl::StatusOr<std::vector<Reconstruction>> SqlJobStore::ListReconstructions(const std::string& after, int64_t limit) {
  MW_ASSIGN_OR_RETURN(const SqlResult result,
                      database_->Run("list_reconstructions", {{"after", after}, {"limit", limit}}));
  std::vector<Reconstruction> all;
  all.reserve(result.rows.size());
  for (const SqlRow& row : result.rows) {
    MW_ASSIGN_OR_RETURN(Reconstruction reconstruction, ReadReconstruction(row));
    all.push_back(std::move(reconstruction));
  }
  return all;
}

absl::Status SqlJobStore::SetReconstructionScene(const std::string& id, const std::string& scene_digest) {
  MW_ASSIGN_OR_RETURN(
      const SqlResult result,
      database_->Run("set_reconstruction_scene", {{"id", id}, {"scene_digest", NullIfEmpty(scene_digest)}}));
  if (result.changed == 1) return absl::OkStatus();
  MW_ASSIGN_OR_RETURN(const Reconstruction stored, GetReconstruction(id));
  if (stored.scene_digest == scene_digest) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("reconstruction ", id, " is ", StateText(stored.state), "; its scene cannot change any more"));
}

absl::Status SqlJobStore::SetReconstructionState(const std::string& id, ReconstructionState state,
                                                 const std::string& reason, int64_t conductor_epoch) {
  MW_ASSIGN_OR_RETURN(const SqlResult result,
                      database_->Run("set_reconstruction_state", {{"id", id},
                                                                  {"state", StateText(state)},
                                                                  {"reason", PrintableText(reason)},
                                                                  {"conductor_epoch", conductor_epoch}}));
  if (result.changed == 1) return absl::OkStatus();
  MW_ASSIGN_OR_RETURN(const Reconstruction stored, GetReconstruction(id));
  MW_RETURN_IF_ERROR(CheckConductor(id, conductor_epoch));
  if (stored.state == state) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("reconstruction ", id, " is ", StateText(stored.state), ", which is final"));
}

absl::Status SqlJobStore::DeleteReconstruction(const std::string& id) {
  return database_->Run("delete_reconstruction", {{"id", id}}).status();
}

absl::Status SqlJobStore::AssignCameraJob(const std::string& id, SequenceNumber sequence, CameraIndex camera,
                                          SequenceNumber snapshot, absl::Time now, int64_t conductor_epoch,
                                          int64_t memory_bytes) {
  const SqlCall call = AssignCall(id, {sequence, camera, snapshot, memory_bytes}, now, conductor_epoch);
  MW_ASSIGN_OR_RETURN(const SqlResult result, database_->Run(call.statement, call.parameters));
  if (result.changed == 1) return absl::OkStatus();
  MW_RETURN_IF_ERROR(CheckConductor(id, conductor_epoch));
  const absl::StatusOr<CameraJob> stored = GetCameraJob(id, sequence);
  if (absl::IsNotFound(stored.status())) {
    return absl::FailedPreconditionError(absl::StrCat("camera ", camera, " already has a job in reconstruction ", id));
  }
  MW_RETURN_IF_ERROR(stored.status());
  if (stored->camera == camera && stored->snapshot == snapshot) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrCat(CameraJobName(id, sequence), " is camera ", stored->camera,
                                                    " at snapshot ", stored->snapshot, ", not camera ", camera,
                                                    " at snapshot ", snapshot));
}

absl::StatusOr<int64_t> SqlJobStore::ReassignCameraJob(const std::string& id, SequenceNumber sequence, absl::Time now) {
  MW_ASSIGN_OR_RETURN(
      const SqlResult result,
      database_->Run("reassign_camera_job", {{"id", id}, {"sequence", sequence}, {"now", absl::ToUnixMicros(now)}}));
  if (!result.rows.empty()) return result.rows.front().Integer(0);
  MW_RETURN_IF_ERROR(GetCameraJob(id, sequence).status());
  return absl::FailedPreconditionError(absl::StrCat(CameraJobName(id, sequence), " is finished already"));
}

absl::Status SqlJobStore::CompleteCameraJob(const std::string& id, SequenceNumber sequence, int64_t epoch,
                                            const std::string& filtered_digest,
                                            const std::vector<CameraIndex>& weak_targets,
                                            const std::string& report_json, absl::Time now) {
  MW_ASSIGN_OR_RETURN(const SqlResult result,
                      database_->Run("complete_camera_job", {{"id", id},
                                                             {"sequence", sequence},
                                                             {"epoch", epoch},
                                                             {"filtered_digest", filtered_digest},
                                                             {"weak_targets", JoinCameraIndices(weak_targets)},
                                                             {"report_json", report_json},
                                                             {"now", absl::ToUnixMicros(now)}}));
  if (result.changed == 1) return absl::OkStatus();
  MW_ASSIGN_OR_RETURN(const CameraJob job, GetFencedCameraJob(id, sequence, epoch));
  if (job.state == CameraJobState::kDone && job.filtered_digest == filtered_digest) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrCat(CameraJobName(id, sequence), " has another result already"));
}

absl::Status SqlJobStore::SetCameraJobAside(const std::string& id, SequenceNumber sequence, int64_t epoch,
                                            const std::string& reason, absl::Time now) {
  MW_ASSIGN_OR_RETURN(const SqlResult result,
                      database_->Run("set_camera_job_aside", {{"id", id},
                                                              {"sequence", sequence},
                                                              {"epoch", epoch},
                                                              {"reason", PrintableText(reason)},
                                                              {"now", absl::ToUnixMicros(now)}}));
  if (result.changed == 1) return absl::OkStatus();
  MW_ASSIGN_OR_RETURN(const CameraJob job, GetFencedCameraJob(id, sequence, epoch));
  if (job.state == CameraJobState::kSetAside) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrCat(CameraJobName(id, sequence), " is done already"));
}

absl::StatusOr<CameraJob> SqlJobStore::GetCameraJob(const std::string& id, SequenceNumber sequence) {
  MW_ASSIGN_OR_RETURN(const SqlResult result, database_->Run("get_camera_job", {{"id", id}, {"sequence", sequence}}));
  if (result.rows.empty()) return absl::NotFoundError(absl::StrCat("no ", CameraJobName(id, sequence)));
  return ReadCameraJob(result.rows.front());
}

absl::StatusOr<std::vector<CameraJob>> SqlJobStore::ListCameraJobs(const std::string& id, SequenceNumber after) {
  MW_ASSIGN_OR_RETURN(const SqlResult result, database_->Run("list_camera_jobs", {{"id", id}, {"after", after}}));
  std::vector<CameraJob> jobs;
  jobs.reserve(result.rows.size());
  for (const SqlRow& row : result.rows) {
    MW_ASSIGN_OR_RETURN(CameraJob job, ReadCameraJob(row));
    jobs.push_back(std::move(job));
  }
  return jobs;
}

absl::Status SqlJobStore::AddCommit(const std::string& id, const Commit& commit, absl::Time now,
                                    int64_t conductor_epoch) {
  const SqlCall call = CommitCall(id, commit, now, conductor_epoch);
  MW_ASSIGN_OR_RETURN(const SqlResult result, database_->Run(call.statement, call.parameters));
  if (result.changed == 1) return absl::OkStatus();
  MW_RETURN_IF_ERROR(CheckConductor(id, conductor_epoch));
  MW_ASSIGN_OR_RETURN(const SqlResult stored,
                      database_->Run("get_commit", {{"id", id}, {"sequence", commit.sequence}}));
  if (!stored.rows.empty() && ReadCommit(stored.rows.front()) == commit) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("commit ", commit.sequence, " of reconstruction ", id, " is another one already"));
}

absl::Status SqlJobStore::Advance(const std::string& id, const std::vector<Commit>& commits,
                                  const std::vector<CameraAssignment>& assignments, absl::Time now,
                                  int64_t conductor_epoch) {
  std::vector<SqlCall> calls;
  calls.reserve(commits.size() + assignments.size());
  for (const Commit& commit : commits) calls.push_back(CommitCall(id, commit, now, conductor_epoch));
  for (const CameraAssignment& assignment : assignments) {
    calls.push_back(AssignCall(id, assignment, now, conductor_epoch));
  }
  if (calls.empty()) return absl::OkStatus();
  const absl::StatusOr<bool> done = database_->RunTogether(calls);
  if (done.ok() && *done) return absl::OkStatus();
  if (absl::IsUnavailable(done.status())) return done.status();
  // Something is there already, or is refused: one by one tells which, and why.
  for (const Commit& commit : commits) MW_RETURN_IF_ERROR(AddCommit(id, commit, now, conductor_epoch));
  for (const CameraAssignment& assignment : assignments) {
    MW_RETURN_IF_ERROR(AssignCameraJob(id, assignment.sequence, assignment.camera, assignment.snapshot, now,
                                       conductor_epoch, assignment.memory_bytes));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<Commit>> SqlJobStore::ListCommits(const std::string& id, SequenceNumber after) {
  MW_ASSIGN_OR_RETURN(const SqlResult result, database_->Run("list_commits", {{"id", id}, {"after", after}}));
  std::vector<Commit> commits;
  commits.reserve(result.rows.size());
  for (const SqlRow& row : result.rows) commits.push_back(ReadCommit(row));
  return commits;
}

absl::StatusOr<CameraJob> SqlJobStore::GetFencedCameraJob(const std::string& id, SequenceNumber sequence,
                                                          int64_t epoch) {
  MW_ASSIGN_OR_RETURN(CameraJob job, GetCameraJob(id, sequence));
  if (job.epoch != epoch) {
    return absl::AbortedError(absl::StrCat(CameraJobName(id, sequence), " was handed out again (epoch ", job.epoch,
                                           "); epoch ", epoch, " may not write any more"));
  }
  return job;
}

}  // namespace meshwright
