#include "coordinator/store/sqlite_job_store.h"

#include <mutex>
#include <optional>
#include <utility>

#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"
#include "coordinator/store/sqlite_connection.h"

namespace meshwright {
namespace {

std::optional<std::string> NullIfEmpty(const std::string& text) {
  return text.empty() ? std::nullopt : std::make_optional(text);
}

std::string StateText(ReconstructionState state) { return state == ReconstructionState::kDone ? "done" : "running"; }

Reconstruction ReadReconstruction(const SqliteStatement& row) {
  return {.id = row.Text(0),
          .options_json = row.Text(1),
          .scene_digest = row.Text(2),
          .state = row.Text(3) == "done" ? ReconstructionState::kDone : ReconstructionState::kRunning};
}

absl::StatusOr<CameraJob> ReadCameraJob(const SqliteStatement& row) {
  CameraJob job;
  job.sequence = static_cast<SequenceNumber>(row.Integer(0));
  job.camera = static_cast<CameraIndex>(row.Integer(1));
  job.snapshot = static_cast<SequenceNumber>(row.Integer(2));
  const std::string state = row.Text(3);
  job.state = state == "done"        ? CameraJobState::kDone
              : state == "set_aside" ? CameraJobState::kSetAside
                                     : CameraJobState::kAssigned;
  job.epoch = row.Integer(4);
  job.filtered_digest = row.Text(5);
  MW_ASSIGN_OR_RETURN(job.weak_targets, SplitCameraIndices(row.Text(6)));
  job.report_json = row.Text(7);
  job.set_aside_reason = row.Text(8);
  return job;
}

Commit ReadCommit(const SqliteStatement& row) {
  return {.sequence = static_cast<SequenceNumber>(row.Integer(0)),
          .camera = static_cast<CameraIndex>(row.Integer(1)),
          .accepted_digest = row.Text(2),
          .filtered_patches = row.Integer(3),
          .accepted_patches = row.Integer(4)};
}

std::string JobName(const std::string& id, SequenceNumber sequence) {
  return absl::StrCat("camera job ", sequence, " of reconstruction ", id);
}

class SqliteJobStore : public JobStore {
 public:
  explicit SqliteJobStore(SqliteConnection connection) : connection_(std::move(connection)) {}

  absl::Status CreateReconstruction(const Reconstruction& reconstruction, absl::Time now) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    MW_ASSIGN_OR_RETURN(SqliteStatement statement, connection_.Prepare("create_reconstruction"));
    return statement.Bind(":id", reconstruction.id)
        .Bind(":options_json", reconstruction.options_json)
        .Bind(":scene_digest", reconstruction.scene_digest)
        .Bind(":state", StateText(reconstruction.state))
        .Bind(":now", absl::ToUnixMicros(now))
        .Run()
        .status();
  }

  absl::StatusOr<Reconstruction> GetReconstruction(const std::string& id) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    MW_ASSIGN_OR_RETURN(SqliteStatement statement, connection_.Prepare("get_reconstruction"));
    MW_ASSIGN_OR_RETURN(const bool found, statement.Bind(":id", id).Step());
    if (!found) return absl::NotFoundError(absl::StrCat("no reconstruction ", id));
    return ReadReconstruction(statement);
  }

  absl::StatusOr<std::vector<Reconstruction>> ListReconstructions() override {
    const std::lock_guard<std::mutex> lock(mutex_);
    MW_ASSIGN_OR_RETURN(SqliteStatement statement, connection_.Prepare("list_reconstructions"));
    std::vector<Reconstruction> all;
    while (true) {
      MW_ASSIGN_OR_RETURN(const bool row, statement.Step());
      if (!row) return all;
      all.push_back(ReadReconstruction(statement));
    }
  }

  absl::Status SetReconstructionState(const std::string& id, ReconstructionState state) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    MW_ASSIGN_OR_RETURN(SqliteStatement statement, connection_.Prepare("set_reconstruction_state"));
    MW_ASSIGN_OR_RETURN(const int64_t changed, statement.Bind(":id", id).Bind(":state", StateText(state)).Run());
    if (changed == 0) return absl::NotFoundError(absl::StrCat("no reconstruction ", id));
    return absl::OkStatus();
  }

  absl::Status AssignCameraJob(const std::string& id, SequenceNumber sequence, CameraIndex camera,
                               SequenceNumber snapshot, absl::Time now) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    return connection_.Transaction([&]() -> absl::Status {
      const absl::StatusOr<CameraJob> stored = GetCameraJob(id, sequence);
      if (stored.ok()) {
        if (stored->camera == camera && stored->snapshot == snapshot) return absl::OkStatus();
        return absl::FailedPreconditionError(absl::StrCat(JobName(id, sequence), " is camera ", stored->camera,
                                                          " at snapshot ", stored->snapshot, ", not camera ", camera,
                                                          " at snapshot ", snapshot));
      }
      if (!absl::IsNotFound(stored.status())) return stored.status();
      MW_ASSIGN_OR_RETURN(SqliteStatement statement, connection_.Prepare("assign_camera_job"));
      absl::Status status = statement.Bind(":id", id)
                                .Bind(":sequence", sequence)
                                .Bind(":camera", camera)
                                .Bind(":snapshot", snapshot)
                                .Bind(":now", absl::ToUnixMicros(now))
                                .Run()
                                .status();
      // The sequence number is free, so it is the camera that has a job already.
      if (absl::IsAlreadyExists(status)) {
        return absl::FailedPreconditionError(
            absl::StrCat("camera ", camera, " already has a job in reconstruction ", id));
      }
      return status;
    });
  }

  absl::StatusOr<int64_t> ReassignCameraJob(const std::string& id, SequenceNumber sequence, absl::Time now) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    int64_t epoch = 0;
    MW_RETURN_IF_ERROR(connection_.Transaction([&]() -> absl::Status {
      MW_ASSIGN_OR_RETURN(SqliteStatement statement, connection_.Prepare("reassign_camera_job"));
      statement.Bind(":id", id).Bind(":sequence", sequence).Bind(":now", absl::ToUnixMicros(now));
      MW_ASSIGN_OR_RETURN(const bool changed, statement.Step());
      if (changed) {
        epoch = statement.Integer(0);
        return absl::OkStatus();
      }
      MW_RETURN_IF_ERROR(GetCameraJob(id, sequence).status());
      return absl::FailedPreconditionError(absl::StrCat(JobName(id, sequence), " is finished already"));
    }));
    return epoch;
  }

  absl::Status CompleteCameraJob(const std::string& id, SequenceNumber sequence, int64_t epoch,
                                 const std::string& filtered_digest, const std::vector<CameraIndex>& weak_targets,
                                 const std::string& report_json, absl::Time now) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    return connection_.Transaction([&]() -> absl::Status {
      MW_ASSIGN_OR_RETURN(SqliteStatement statement, connection_.Prepare("complete_camera_job"));
      statement.Bind(":id", id)
          .Bind(":sequence", sequence)
          .Bind(":epoch", epoch)
          .Bind(":filtered_digest", filtered_digest)
          .Bind(":weak_targets", JoinCameraIndices(weak_targets))
          .Bind(":report_json", report_json)
          .Bind(":now", absl::ToUnixMicros(now));
      MW_ASSIGN_OR_RETURN(const int64_t changed, statement.Run());
      if (changed == 1) return absl::OkStatus();
      MW_ASSIGN_OR_RETURN(const CameraJob job, GetFencedCameraJob(id, sequence, epoch));
      if (job.state == CameraJobState::kDone && job.filtered_digest == filtered_digest) return absl::OkStatus();
      return absl::FailedPreconditionError(absl::StrCat(JobName(id, sequence), " has another result already"));
    });
  }

  absl::Status SetCameraJobAside(const std::string& id, SequenceNumber sequence, int64_t epoch,
                                 const std::string& reason, absl::Time now) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    return connection_.Transaction([&]() -> absl::Status {
      MW_ASSIGN_OR_RETURN(SqliteStatement statement, connection_.Prepare("set_camera_job_aside"));
      statement.Bind(":id", id)
          .Bind(":sequence", sequence)
          .Bind(":epoch", epoch)
          .Bind(":reason", reason)
          .Bind(":now", absl::ToUnixMicros(now));
      MW_ASSIGN_OR_RETURN(const int64_t changed, statement.Run());
      if (changed == 1) return absl::OkStatus();
      MW_ASSIGN_OR_RETURN(const CameraJob job, GetFencedCameraJob(id, sequence, epoch));
      if (job.state == CameraJobState::kSetAside) return absl::OkStatus();
      return absl::FailedPreconditionError(absl::StrCat(JobName(id, sequence), " is done already"));
    });
  }

  absl::StatusOr<std::vector<CameraJob>> ListCameraJobs(const std::string& id) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    MW_ASSIGN_OR_RETURN(SqliteStatement statement, connection_.Prepare("list_camera_jobs"));
    statement.Bind(":id", id);
    std::vector<CameraJob> jobs;
    while (true) {
      MW_ASSIGN_OR_RETURN(const bool row, statement.Step());
      if (!row) return jobs;
      MW_ASSIGN_OR_RETURN(CameraJob job, ReadCameraJob(statement));
      jobs.push_back(std::move(job));
    }
  }

  absl::Status AddCommit(const std::string& id, const Commit& commit, absl::Time now) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    return connection_.Transaction([&]() -> absl::Status {
      MW_ASSIGN_OR_RETURN(SqliteStatement stored, connection_.Prepare("get_commit"));
      MW_ASSIGN_OR_RETURN(const bool exists, stored.Bind(":id", id).Bind(":sequence", commit.sequence).Step());
      if (exists) {
        if (ReadCommit(stored) == commit) return absl::OkStatus();
        return absl::FailedPreconditionError(
            absl::StrCat("commit ", commit.sequence, " of reconstruction ", id, " is another one already"));
      }
      MW_ASSIGN_OR_RETURN(SqliteStatement statement, connection_.Prepare("add_commit"));
      return statement.Bind(":id", id)
          .Bind(":sequence", commit.sequence)
          .Bind(":camera", commit.camera)
          .Bind(":accepted_digest", NullIfEmpty(commit.accepted_digest))
          .Bind(":filtered_patches", commit.filtered_patches)
          .Bind(":accepted_patches", commit.accepted_patches)
          .Bind(":now", absl::ToUnixMicros(now))
          .Run()
          .status();
    });
  }

  absl::StatusOr<std::vector<Commit>> ListCommits(const std::string& id) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    MW_ASSIGN_OR_RETURN(SqliteStatement statement, connection_.Prepare("list_commits"));
    statement.Bind(":id", id);
    std::vector<Commit> commits;
    while (true) {
      MW_ASSIGN_OR_RETURN(const bool row, statement.Step());
      if (!row) return commits;
      commits.push_back(ReadCommit(statement));
    }
  }

 private:
  absl::StatusOr<CameraJob> GetCameraJob(const std::string& id, SequenceNumber sequence) {
    MW_ASSIGN_OR_RETURN(SqliteStatement statement, connection_.Prepare("get_camera_job"));
    MW_ASSIGN_OR_RETURN(const bool found, statement.Bind(":id", id).Bind(":sequence", sequence).Step());
    if (!found) return absl::NotFoundError(absl::StrCat("no ", JobName(id, sequence)));
    return ReadCameraJob(statement);
  }

  absl::StatusOr<CameraJob> GetFencedCameraJob(const std::string& id, SequenceNumber sequence, int64_t epoch) {
    MW_ASSIGN_OR_RETURN(CameraJob job, GetCameraJob(id, sequence));
    if (job.epoch != epoch) {
      return absl::AbortedError(absl::StrCat(JobName(id, sequence), " was handed out again (epoch ", job.epoch,
                                             "); epoch ", epoch, " may not write any more"));
    }
    return job;
  }

  std::mutex mutex_;
  SqliteConnection connection_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<JobStore>> OpenSqliteJobStore(const std::string& path) {
  MW_ASSIGN_OR_RETURN(SqliteConnection connection, SqliteConnection::Open(path));
  return std::make_unique<SqliteJobStore>(std::move(connection));
}

}  // namespace meshwright
