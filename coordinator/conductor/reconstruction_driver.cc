#include "coordinator/conductor/reconstruction_driver.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>

#include <absl/strings/str_cat.h>

#include "common/base/bad_input.h"
#include "common/base/digest.h"
#include "common/base/files.h"
#include "common/base/status_macros.h"
#include "common/base/utf8.h"
#include "common/blob/lost_blob.h"
#include "common/scene/scene_codec.h"
#include "common/scene/view.h"
#include "coordinator/conductor/accepted_mesh.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

// Errors of the store and the blobs (a full disk, a server that is away) are waited out for some minutes.
constexpr int kMaxFailures = 12;
constexpr std::chrono::seconds kRetryDelay(10);
// Results that other coordinators took are noticed by looking again.
constexpr std::chrono::milliseconds kPollInterval(250);
// A job is made smaller at most so often; each time its lattice is spaced twice as wide.
constexpr int kMaxReductions = 2;
constexpr int kMaxRepairsInARow = 100;

bool IsPermanent(const absl::Status& status) {
  return IsBadInput(status) || absl::IsInvalidArgument(status) || absl::IsFailedPrecondition(status) ||
         absl::IsDataLoss(status);
}

absl::Status Stopped() { return absl::CancelledError("stopped"); }

struct FileFacts {
  int64_t bytes = 0;
  std::string sha256;
};

absl::StatusOr<FileFacts> FactsOf(const std::string& path) {
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rb"), std::fclose);
  if (file == nullptr) return absl::InternalError(absl::StrCat(path, ": cannot be read"));
  std::vector<uint8_t> buffer(size_t{1} << 20);
  Sha256Stream digest;
  FileFacts facts;
  while (const size_t count = std::fread(buffer.data(), 1, buffer.size(), file.get())) {
    digest.Update(absl::MakeConstSpan(buffer.data(), count));
    facts.bytes += static_cast<int64_t>(count);
  }
  facts.sha256 = digest.HexDigest();
  return facts;
}

}  // namespace

ReconstructionDriver::ReconstructionDriver(const DriverEnvironment& environment, const CoordinatorFolders& folders,
                                           std::string id, int64_t epoch, bool is_deleting,
                                           std::function<void(bool)> changed)
    : environment_(environment),
      folders_(folders),
      id_(std::move(id)),
      epoch_(epoch),
      is_deleting_(is_deleting),
      changed_(std::move(changed)),
      referenced_blobs_(id_, *environment.store, *environment.blobs) {
  thread_ = std::thread([this] {
    Run();
    has_ended_ = true;
    changed_(true);
  });
}

ReconstructionDriver::~ReconstructionDriver() {
  RequestStop();
  thread_.join();
}

void ReconstructionDriver::RequestStop() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
}

void ReconstructionDriver::Wake() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    has_news_ = true;
  }
  wake_.notify_all();
}

bool ReconstructionDriver::WaitForNews() {
  std::unique_lock<std::mutex> lock(mutex_);
  wake_.wait_for(lock, kPollInterval, [&] { return stopping_ || has_news_; });
  has_news_ = false;
  return !stopping_;
}

absl::Status ReconstructionDriver::SetState(ReconstructionState state, const std::string& reason) {
  const absl::Status status =
      environment_.store->SetReconstructionState(id_, state, environment_.clock->Now(), ToUtf8(reason), epoch_);
  changed_(false);
  // Cancelled or deleted meanwhile.
  return absl::IsFailedPrecondition(status) || absl::IsNotFound(status) ? Stopped() : status;
}

void ReconstructionDriver::Run() {
  for (int failures = 1;; ++failures) {
    const absl::Status status = Conduct();
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      // Aborted: somebody else conducts it now.
      if (status.ok() || stopping_ || absl::IsCancelled(status) || absl::IsAborted(status)) return;
    }
    if (IsPermanent(status) || failures == kMaxFailures) {
      SetState(ReconstructionState::kFailed, std::string(status.message())).IgnoreError();
      return;
    }
    std::unique_lock<std::mutex> lock(mutex_);
    if (wake_.wait_for(lock, kRetryDelay, [&] { return stopping_; })) return;
  }
}

absl::Status ReconstructionDriver::Conduct() {
  if (is_deleting_) return DeleteEverything();
  MW_ASSIGN_OR_RETURN(record_, environment_.store->GetReconstruction(id_));
  if (IsFinal(record_.state) || record_.state == ReconstructionState::kDeleting) return absl::OkStatus();
  MW_ASSIGN_OR_RETURN(const ReconstructionConfig config, environment_.parse_config(record_.options_json));
  MW_RETURN_IF_ERROR(PrepareScene(config));
  MW_ASSIGN_OR_RETURN(const std::unique_ptr<Conductor> conductor, OpenConductor(config));
  MW_RETURN_IF_ERROR(SetState(ReconstructionState::kRunning));
  environment_.jobs_changed();
  MW_RETURN_IF_ERROR(RunJobs(*conductor));
  return Join(config, *conductor);
}

absl::Status ReconstructionDriver::DeleteEverything() {
  MW_ASSIGN_OR_RETURN(const std::vector<std::string> blobs, environment_.store->MarkBlobsForDeletion(id_));
  for (const std::string& digest : blobs) {
    MW_RETURN_IF_ERROR(environment_.blobs->Delete(digest));
    const std::lock_guard<std::mutex> lock(mutex_);
    if (stopping_) return Stopped();
  }
  return environment_.store->DeleteReconstruction(id_);
}

absl::StatusOr<std::string> ReconstructionDriver::SceneFolder(bool* is_temporary) {
  *is_temporary = record_.scene_reference.empty();
  if (!*is_temporary) {
    absl::StatusOr<std::string> folder = ResolveSceneReference(record_.scene_reference, folders_.scene_roots);
    if (!folder.ok()) return BadInput(folder.status());
    return folder;
  }
  std::string folder = absl::StrCat(folders_.data, "/uploads/", id_, "-", epoch_);
  MW_ASSIGN_OR_RETURN(const std::vector<SceneFile> files, environment_.store->ListSceneFiles(id_));
  MW_RETURN_IF_ERROR(MaterializeScene(files, *environment_.blobs, folder));
  return folder;
}

absl::StatusOr<IngestedScene> ReconstructionDriver::Take() {
  bool is_temporary = false;
  MW_ASSIGN_OR_RETURN(const std::string folder, SceneFolder(&is_temporary));
  absl::StatusOr<IngestedScene> taken = IngestScene(
      folder, is_temporary ? folder : SceneRootOf(folder, folders_.scene_roots), referenced_blobs_, *environment_.pool);
  std::error_code error;
  if (is_temporary) fs::remove_all(folder, error);
  return taken;
}

absl::Status ReconstructionDriver::PrepareScene(const ReconstructionConfig& config) {
  if (record_.scene_blob.empty()) {
    MW_ASSIGN_OR_RETURN(const IngestedScene taken, Take());
    MW_RETURN_IF_ERROR(environment_.store->SetReconstructionScene(id_, taken.scene_digest, taken.scene_blob, epoch_));
    record_.scene_blob = taken.scene_blob;
  }
  absl::StatusOr<std::string> bytes = environment_.blobs->Get(record_.scene_blob);
  if (IsBlobLost(bytes.status())) {
    MW_ASSIGN_OR_RETURN(const IngestedScene taken, Take());
    bytes = environment_.blobs->Get(record_.scene_blob);
  }
  MW_RETURN_IF_ERROR(bytes.status());
  MW_ASSIGN_OR_RETURN(Scene scene, DecodeScene(*bytes));
  cameras_.clear();
  photographs_.clear();
  for (const SceneView& view : scene.views) {
    cameras_.push_back(UndistortedCamera(view, config.max_image_size));
    photographs_[view.image_path] = view.name;
    if (!view.mask_path.empty()) photographs_[view.mask_path] = view.name + " (its mask)";
  }
  points_ = std::move(scene.points);
  offset_ = scene.offset;
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<Conductor>> ReconstructionDriver::OpenConductor(const ReconstructionConfig& config) {
  const auto job_bytes = [this, &config](CameraJobSpec spec) {
    std::vector<int64_t> bytes;
    for (spec.reduction = 0; spec.reduction <= kMaxReductions; ++spec.reduction) {
      bytes.push_back(config.job_bytes(spec, cameras_));
    }
    return bytes;
  };
  absl::StatusOr<std::unique_ptr<Conductor>> conductor =
      Conductor::Open(id_, cameras_, points_, config.conductor, environment_.store, environment_.blobs,
                      environment_.clock, environment_.pool, {.epoch = epoch_, .job_bytes = job_bytes});
  if (absl::IsFailedPrecondition(conductor.status())) return BadInput(conductor.status());
  return conductor;
}

absl::Status ReconstructionDriver::RunJobs(Conductor& conductor) {
  while (true) {
    absl::StatusOr<bool> handed_out = conductor.IngestResults(environment_.max_failures);
    if (const std::string damaged = conductor.damaged_blob(); !handed_out.ok() && !damaged.empty()) {
      MW_RETURN_IF_ERROR(Repair(conductor, damaged));
      continue;
    }
    MW_RETURN_IF_ERROR(handed_out.status());
    if (*handed_out) environment_.jobs_changed();
    changed_(false);
    MW_RETURN_IF_ERROR(LookAtReports(conductor));
    if (conductor.finished()) return absl::OkStatus();
    if (!WaitForNews()) return Stopped();
  }
}

absl::Status ReconstructionDriver::LookAtReports(Conductor& conductor) {
  MW_ASSIGN_OR_RETURN(const std::vector<std::string> reported, environment_.store->ListDamagedBlobs(id_));
  for (const std::string& digest : reported) {
    const absl::Status status = environment_.blobs->Get(digest).status();
    if (IsBlobLost(status)) MW_RETURN_IF_ERROR(Repair(conductor, digest));
    if (!status.ok() && !IsBlobLost(status)) return status;
    MW_RETURN_IF_ERROR(environment_.store->ForgetDamagedBlob(id_, digest));
  }
  return absl::OkStatus();
}

// What is lost is made again, and must come out the same: a surface by its job or its acceptance, a photograph from the
// scene, as long as that is there.
absl::Status ReconstructionDriver::Repair(Conductor& conductor, const std::string& digest) {
  const auto photograph = photographs_.find(digest);
  if (photograph != photographs_.end() || digest == record_.scene_blob) {
    const std::string what = photograph == photographs_.end() ? "the scene's cameras and points"
                                                              : absl::StrCat("photograph ", photograph->second);
    const absl::StatusOr<IngestedScene> taken = Take();
    if (taken.ok() && taken->scene_blob == record_.scene_blob) return absl::OkStatus();
    if (!taken.ok() && !IsPermanent(taken.status()) && !absl::IsNotFound(taken.status())) return taken.status();
    return absl::DataLossError(
        absl::StrCat(what, " is damaged or lost (blob ", digest, "), and cannot be read again: ",
                     taken.ok() ? std::string("the scene is not what it was") : std::string(taken.status().message())));
  }
  if (const SequenceNumber job = conductor.JobOfFiltered(digest); job > 0) return RunAgain(job, digest);
  for (int attempt = 0; attempt < kMaxRepairsInARow; ++attempt) {
    const absl::Status remade = conductor.RemakeAccepted(digest);
    const std::string also = conductor.damaged_blob();
    if (remade.ok() || also.empty()) return remade;
    const SequenceNumber job = conductor.JobOfFiltered(also);
    if (job == 0) return remade;
    MW_RETURN_IF_ERROR(RunAgain(job, also));
  }
  return absl::DataLossError(absl::StrCat("blob ", digest, " is damaged and cannot be made again"));
}

absl::Status ReconstructionDriver::RunAgain(SequenceNumber sequence, const std::string& digest) {
  JobStore& store = *environment_.store;
  while (true) {
    MW_ASSIGN_OR_RETURN(const CameraJob job, store.GetCameraJob(id_, sequence));
    if (job.state == CameraJobState::kDone) {
      const absl::Status there = environment_.blobs->Get(digest).status();
      if (!IsBlobLost(there)) return there;
      MW_RETURN_IF_ERROR(store.ReopenCameraJob(id_, sequence, job.epoch, digest,
                                               absl::StrCat("its surface is damaged or lost (blob ", digest, ")"),
                                               absl::UnixEpoch(), epoch_));
      environment_.jobs_changed();
    } else if (job.failed_attempts >= environment_.max_failures) {
      return absl::DataLossError(absl::StrCat("surface ", digest, " of camera ", job.camera,
                                              " is damaged or lost and cannot be made again: ", job.last_failure));
    }
    if (!WaitForNews()) return Stopped();
  }
}

absl::Status ReconstructionDriver::Join(const ReconstructionConfig& config, Conductor& conductor) {
  MW_RETURN_IF_ERROR(SetState(ReconstructionState::kJoining));
  const absl::Status nothing = BadInput(absl::FailedPreconditionError(
      absl::StrCat("nothing was reconstructed: no surface was supported by ", config.conductor.acceptance.k_a,
                   " other cameras; are the cameras right, and do the photographs show the same surface?")));
  if (conductor.AcceptedSurfaces().empty()) return nothing;
  MW_ASSIGN_OR_RETURN(const StoredMesh mesh, WriteMesh(config, conductor));
  if (mesh.faces == 0) return nothing;
  const absl::Status finished = environment_.store->FinishReconstruction(id_, mesh, environment_.clock->Now(), epoch_);
  return absl::IsFailedPrecondition(finished) ? Stopped() : finished;
}

absl::StatusOr<StoredMesh> ReconstructionDriver::WriteMesh(const ReconstructionConfig& config, Conductor& conductor) {
  const std::string path = absl::StrCat(folders_.data, "/meshes/", id_, "-", epoch_, ".new");
  absl::StatusOr<JoinedMeshCounts> counts = absl::UnknownError("not tried");
  for (int attempt = 0; attempt < kMaxRepairsInARow && !counts.ok(); ++attempt) {
    LostBlobNamer blobs(*environment_.blobs);
    counts = WriteAcceptedMesh(conductor.AcceptedSurfaces(), blobs, config.join, offset_, path, *environment_.pool);
    if (counts.ok()) break;
    const std::string lost = LostBlobOf(counts.status());
    if (lost.empty()) return counts.status();
    MW_RETURN_IF_ERROR(Repair(conductor, lost));
  }
  MW_RETURN_IF_ERROR(counts.status());
  MW_ASSIGN_OR_RETURN(const FileFacts facts, FactsOf(path));
  MW_RETURN_IF_ERROR(referenced_blobs_.PutFile(path, facts.sha256));
  std::error_code error;
  fs::rename(path, folders_.MeshFile(facts.sha256), error);
  return StoredMesh{.digest = facts.sha256, .bytes = facts.bytes, .vertices = counts->vertices, .faces = counts->faces};
}

}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
