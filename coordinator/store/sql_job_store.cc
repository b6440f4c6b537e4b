// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/sql_job_store.h"

#include <cmath>

#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"

namespace meshwright {
namespace {

constexpr std::pair<ReconstructionState, const char*> kStateTexts[] = {
    {ReconstructionState::kCreated, "created"}, {ReconstructionState::kPreparing, "preparing"},
    {ReconstructionState::kRunning, "running"}, {ReconstructionState::kJoining, "joining"},
    {ReconstructionState::kDone, "done"},       {ReconstructionState::kCancelled, "cancelled"},
    {ReconstructionState::kFailed, "failed"},   {ReconstructionState::kDeleting, "deleting"}};
constexpr double kWeightUnits = 1000;

std::string StateText(ReconstructionState wanted) {
  for (const auto& [state, text] : kStateTexts) {
    if (state == wanted) return text;
  }
  return "";
}

absl::StatusOr<Reconstruction> ReadReconstruction(const SqlRow& row) {
  Reconstruction reconstruction = {.id = row.Text(0), .options_json = row.Text(1), .scene_digest = row.Text(2)};
  MW_ASSIGN_OR_RETURN(reconstruction.state, ReadReconstructionState(row.Text(3)));
  reconstruction.state_reason = row.Text(4);
  reconstruction.weight = static_cast<double>(row.Integer(5)) / kWeightUnits;
  reconstruction.scene_reference = row.Text(6);
  reconstruction.scene_blob = row.Text(7);
  reconstruction.created_at = row.Time(8);
  if (!row.IsNull(9)) reconstruction.finished_at = row.Time(9);
  reconstruction.mesh = {.digest = row.Text(10),
                         .bytes = row.Integer(11),
                         .vertices = row.Integer(12),
                         .faces = row.Integer(13),
                         .verdict_json = row.Text(24)};
  reconstruction.progress = {.cameras_total = row.Integer(14),
                             .cameras_committed = row.Integer(15),
                             .cameras_skipped = row.Integer(16),
                             .cameras_in_flight = row.Integer(17),
                             .patches_filtered = row.Integer(18),
                             .patches_accepted = row.Integer(19),
                             .joined_thousandths = row.Integer(22)};
  if (!row.IsNull(23)) reconstruction.progress.expected_end = row.Time(23);
  reconstruction.owner = row.Text(20);
  reconstruction.method_version = row.Integer(21);
  return reconstruction;
}

absl::StatusOr<std::vector<Reconstruction>> ReadReconstructions(const SqlResult& result) {
  std::vector<Reconstruction> all;
  all.reserve(result.rows.size());
  for (const SqlRow& row : result.rows) {
    MW_ASSIGN_OR_RETURN(Reconstruction reconstruction, ReadReconstruction(row));
    all.push_back(std::move(reconstruction));
  }
  return all;
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
           {"neighbours", JoinCameraIndices(assignment.neighbours)},
           {"spec", assignment.spec},
           {"conductor_epoch", conductor_epoch}}};
}

SqlValue NullIfNever(absl::Time time) {
  return time == absl::InfinitePast() ? SqlValue(std::nullopt) : SqlValue(absl::ToUnixMicros(time));
}

SqlCall ProgressCall(const std::string& id, const Progress& progress, int64_t conductor_epoch) {
  return {"set_progress",
          {{"id", id},
           {"cameras_total", progress.cameras_total},
           {"cameras_committed", progress.cameras_committed},
           {"cameras_set_aside", progress.cameras_skipped},
           {"cameras_in_flight", progress.cameras_in_flight},
           {"patches_filtered", progress.patches_filtered},
           {"patches_accepted", progress.patches_accepted},
           {"joined_thousandths", progress.joined_thousandths},
           {"expected_end", NullIfNever(progress.expected_end)},
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

absl::StatusOr<ReconstructionState> ReadReconstructionState(const std::string& text) {
  for (const auto& [state, name] : kStateTexts) {
    if (text == name) return state;
  }
  return absl::DataLossError(absl::StrCat("a reconstruction has the unknown state ", text));
}

absl::StatusOr<CameraJob> ReadCameraJob(const SqlRow& row) {
  CameraJob job;
  job.sequence = static_cast<SequenceNumber>(row.Integer(1));
  job.camera = static_cast<CameraIndex>(row.Integer(2));
  job.snapshot = static_cast<SequenceNumber>(row.Integer(3));
  job.state = row.Text(4) == "done"        ? CameraJobState::kDone
              : row.Text(4) == "set_aside" ? CameraJobState::kSkipped
                                           : CameraJobState::kAssigned;
  job.epoch = row.Integer(5);
  job.filtered_digest = row.Text(6);
  MW_ASSIGN_OR_RETURN(job.weak_targets, SplitCameraIndices(row.Text(7)));
  job.report_json = row.Text(8);
  job.skip_reason = row.Text(9);
  job.memory_bytes = row.Integer(10);
  job.failed_attempts = row.Integer(11);
  job.out_of_memory_failures = row.Integer(12);
  job.last_failure = row.Text(13);
  job.not_before = row.Time(14);
  job.lease_worker = row.Text(15);
  job.lease_expires_at = row.Time(16);
  job.losses = row.Integer(17);
  job.reduction = row.Integer(18);
  job.expected_digest = row.Text(19);
  MW_ASSIGN_OR_RETURN(job.neighbours, SplitCameraIndices(row.Text(20)));
  job.lease_instance = row.Text(21);
  job.leased_at = row.Time(22);
  if (row.Columns() > 23) job.spec = row.Text(23);
  return job;
}

absl::Status SqlJobStore::CreateReconstruction(const Reconstruction& reconstruction, absl::Time now) {
  const auto weight = static_cast<int64_t>(std::llround(reconstruction.weight * kWeightUnits));
  return database_
      ->RunAll({{"take_reconstruction_id", {{"id", reconstruction.id}}},
                {"create_reconstruction",
                 {{"id", reconstruction.id},
                  {"options_json", reconstruction.options_json},
                  {"scene_digest", NullIfEmpty(reconstruction.scene_digest)},
                  {"state", StateText(reconstruction.state)},
                  {"now", absl::ToUnixMicros(now)},
                  {"reason", PrintableText(reconstruction.state_reason)},
                  {"weight_thousandths", weight},
                  {"scene_reference", reconstruction.scene_reference},
                  {"owner", reconstruction.owner},
                  {"method_version", reconstruction.method_version}}}})
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
  return ReadReconstructions(result);
}

absl::StatusOr<std::vector<Reconstruction>> SqlJobStore::ListReconstructionsOf(const std::string& owner,
                                                                               const std::string& after,
                                                                               int64_t limit) {
  MW_ASSIGN_OR_RETURN(const SqlResult result, database_->Run("list_reconstructions_of",
                                                             {{"owner", owner}, {"after", after}, {"limit", limit}}));
  return ReadReconstructions(result);
}

absl::Status SqlJobStore::SetReconstructionScene(const std::string& id, const std::string& scene_digest,
                                                 const std::string& scene_blob, int64_t conductor_epoch) {
  MW_ASSIGN_OR_RETURN(const SqlResult result,
                      database_->Run("set_reconstruction_scene", {{"id", id},
                                                                  {"scene_digest", NullIfEmpty(scene_digest)},
                                                                  {"scene_blob", NullIfEmpty(scene_blob)},
                                                                  {"conductor_epoch", conductor_epoch}}));
  if (result.changed == 1) return absl::OkStatus();
  MW_ASSIGN_OR_RETURN(const Reconstruction stored, GetReconstruction(id));
  MW_RETURN_IF_ERROR(CheckConductor(id, conductor_epoch));
  if (stored.scene_digest == scene_digest && stored.scene_blob == scene_blob) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("reconstruction ", id, " is ", StateText(stored.state), "; its scene cannot change any more"));
}

absl::Status SqlJobStore::RequestState(const std::string& id, ReconstructionState state, absl::Time now) {
  MW_ASSIGN_OR_RETURN(const SqlResult result,
                      database_->Run("request_reconstruction_state", {{"id", id},
                                                                      {"state", StateText(state)},
                                                                      {"is_final", IsFinal(state) ? 1 : 0},
                                                                      {"now", absl::ToUnixMicros(now)}}));
  return result.changed == 1 ? absl::OkStatus() : ExplainState(id, state);
}

absl::Status SqlJobStore::SetReconstructionState(const std::string& id, ReconstructionState state,
                                                 const std::string& reason, absl::Time now, int64_t conductor_epoch) {
  MW_ASSIGN_OR_RETURN(const SqlResult result,
                      database_->Run("set_reconstruction_state", {{"id", id},
                                                                  {"state", StateText(state)},
                                                                  {"reason", PrintableText(reason)},
                                                                  {"is_final", IsFinal(state) ? 1 : 0},
                                                                  {"now", absl::ToUnixMicros(now)},
                                                                  {"conductor_epoch", conductor_epoch}}));
  if (result.changed == 1) return absl::OkStatus();
  MW_RETURN_IF_ERROR(CheckConductor(id, conductor_epoch));
  return ExplainState(id, state);
}

absl::Status SqlJobStore::ExplainState(const std::string& id, ReconstructionState state) {
  MW_ASSIGN_OR_RETURN(const Reconstruction stored, GetReconstruction(id));
  if (stored.state == state) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("reconstruction ", id, " is ", StateText(stored.state), ", which is final"));
}

absl::Status SqlJobStore::FinishReconstruction(const std::string& id, const StoredMesh& mesh, absl::Time now,
                                               int64_t conductor_epoch) {
  MW_ASSIGN_OR_RETURN(const SqlResult result,
                      database_->Run("finish_reconstruction", {{"id", id},
                                                               {"mesh_digest", mesh.digest},
                                                               {"mesh_bytes", mesh.bytes},
                                                               {"vertices", mesh.vertices},
                                                               {"faces", mesh.faces},
                                                               {"verdict_json", mesh.verdict_json},
                                                               {"now", absl::ToUnixMicros(now)},
                                                               {"conductor_epoch", conductor_epoch}}));
  if (result.changed == 1) return absl::OkStatus();
  MW_RETURN_IF_ERROR(CheckConductor(id, conductor_epoch));
  return ExplainState(id, ReconstructionState::kDone);
}

absl::Status SqlJobStore::BeginDeletion(const std::string& id) {
  MW_ASSIGN_OR_RETURN(const SqlResult result, database_->Run("begin_deletion", {{"id", id}}));
  return result.changed == 1 ? absl::OkStatus() : GetReconstruction(id).status();
}

absl::Status SqlJobStore::DeleteReconstruction(const std::string& id) {
  return database_->Run("delete_reconstruction", {{"id", id}}).status();
}

absl::Status SqlJobStore::AssignCameraJob(const std::string& id, const CameraAssignment& assignment, absl::Time now,
                                          int64_t conductor_epoch) {
  const SqlCall call = AssignCall(id, assignment, now, conductor_epoch);
  MW_ASSIGN_OR_RETURN(const SqlResult result, database_->Run(call.statement, call.parameters));
  if (result.changed == 1) return absl::OkStatus();
  MW_RETURN_IF_ERROR(CheckConductor(id, conductor_epoch));
  const absl::StatusOr<CameraJob> stored = GetCameraJob(id, assignment.sequence);
  if (absl::IsNotFound(stored.status())) {
    return absl::FailedPreconditionError(
        absl::StrCat("camera ", assignment.camera, " already has a job in reconstruction ", id));
  }
  MW_RETURN_IF_ERROR(stored.status());
  if (stored->camera == assignment.camera && stored->snapshot == assignment.snapshot) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrCat(CameraJobName(id, assignment.sequence), " is camera ",
                                                    stored->camera, " at snapshot ", stored->snapshot, ", not camera ",
                                                    assignment.camera, " at snapshot ", assignment.snapshot));
}

absl::Status SqlJobStore::ReopenCameraJob(const std::string& id, SequenceNumber sequence, int64_t epoch,
                                          const std::string& expected_digest, const std::string& reason,
                                          absl::Time retry_at, int64_t conductor_epoch) {
  MW_ASSIGN_OR_RETURN(const SqlResult result,
                      database_->Run("reopen_camera_job", {{"id", id},
                                                           {"sequence", sequence},
                                                           {"epoch", epoch},
                                                           {"expected_digest", NullIfEmpty(expected_digest)},
                                                           {"reason", PrintableText(reason)},
                                                           {"retry_at", absl::ToUnixMicros(retry_at)},
                                                           {"conductor_epoch", conductor_epoch}}));
  if (result.changed == 1) return absl::OkStatus();
  MW_RETURN_IF_ERROR(CheckConductor(id, conductor_epoch));
  MW_RETURN_IF_ERROR(GetCameraJob(id, sequence).status());
  return absl::AbortedError(absl::StrCat(CameraJobName(id, sequence), " is not done in epoch ", epoch));
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

absl::StatusOr<std::vector<JobResult>> SqlJobStore::ListResults(const std::string& id, SequenceNumber after) {
  MW_ASSIGN_OR_RETURN(const SqlResult result, database_->Run("list_outcomes", {{"id", id}, {"after", after}}));
  std::vector<JobResult> results;
  results.reserve(result.rows.size());
  for (const SqlRow& row : result.rows) {
    JobResult one = {.sequence = static_cast<SequenceNumber>(row.Integer(0)),
                     .skipped = row.Text(1) == "set_aside",
                     .epoch = row.Integer(2),
                     .filtered_digest = row.Text(3)};
    MW_ASSIGN_OR_RETURN(one.weak_targets, SplitCameraIndices(row.Text(4)));
    results.push_back(std::move(one));
  }
  return results;
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
                                  const std::vector<CameraAssignment>& assignments, const Progress& progress,
                                  absl::Time now, int64_t conductor_epoch) {
  std::vector<SqlCall> calls;
  calls.reserve(commits.size() + assignments.size() + 1);
  for (const Commit& commit : commits) calls.push_back(CommitCall(id, commit, now, conductor_epoch));
  for (const CameraAssignment& assignment : assignments) {
    calls.push_back(AssignCall(id, assignment, now, conductor_epoch));
  }
  calls.push_back(ProgressCall(id, progress, conductor_epoch));
  const absl::StatusOr<bool> done = database_->RunTogether(calls);
  if (done.ok() && *done) return absl::OkStatus();
  if (absl::IsUnavailable(done.status())) return done.status();
  // Something is there already, or is refused: one by one tells which, and why.
  for (const Commit& commit : commits) MW_RETURN_IF_ERROR(AddCommit(id, commit, now, conductor_epoch));
  for (const CameraAssignment& assignment : assignments) {
    MW_RETURN_IF_ERROR(AssignCameraJob(id, assignment, now, conductor_epoch));
  }
  MW_ASSIGN_OR_RETURN(const SqlResult result, database_->Run(calls.back().statement, calls.back().parameters));
  return result.changed == 1 ? absl::OkStatus() : CheckConductor(id, conductor_epoch);
}

absl::StatusOr<std::vector<Commit>> SqlJobStore::ListCommits(const std::string& id, SequenceNumber after,
                                                             int64_t limit) {
  MW_ASSIGN_OR_RETURN(const SqlResult result,
                      database_->Run("list_commits", {{"id", id}, {"after", after}, {"limit", limit}}));
  std::vector<Commit> commits;
  commits.reserve(result.rows.size());
  for (const SqlRow& row : result.rows) commits.push_back(ReadCommit(row));
  return commits;
}

}  // namespace meshwright
