// SPDX-License-Identifier: Apache-2.0
#include "coordinator/conductor/reconstruction_driver.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <new>

#include <absl/strings/str_cat.h>

#include "common/base/bad_input.h"
#include "common/base/digest.h"
#include "common/base/files.h"
#include "common/base/relative_path.h"
#include "common/base/status_macros.h"
#include "common/base/utf8.h"
#include "common/blob/lost_blob.h"
#include "common/job/camera_refinement.h"
#include "common/job/job_spec_codec.h"
#include "common/scene/formats/import.h"
#include "common/scene/scene_codec.h"
#include "common/scene/view.h"
#include "coordinator/conductor/accepted_mesh.h"
#include "coordinator/conductor/final_surfaces.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

// Errors of the store and the blobs (a full disk, a server that is away) are waited out for some minutes.
constexpr int kMaxFailures = 12;
constexpr std::chrono::seconds kRetryDelay(10);
// Results that other coordinators took are told; what was told and not heard is found by looking again.
constexpr std::chrono::seconds kLookAgain(2);
constexpr int kMaxRepairsInARow = 100;

// How often it is told how far the mesh is, which the store is written for.
constexpr absl::Duration kTellEvery = absl::Seconds(1);
constexpr double kThousandths = 1000;

// COLMAP is a process of its own, whose memory its worker does not know; a worker of the smallest kind takes the job.
constexpr int64_t kEstimationBytes = int64_t{512} << 20;
// A dozen photographs at a thousand pixels, and one as it is.
constexpr int64_t kRefinementBytes = int64_t{384} << 20;

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
                                           std::string id, HeldConductorLease lease, bool is_deleting,
                                           std::function<void(bool)> changed)
    : environment_(environment),
      folders_(folders),
      id_(std::move(id)),
      lease_(std::move(lease)),
      epoch_(lease_.epoch()),
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
    const MutexLock lock(mutex_);
    stopping_ = true;
  }
  wake_.NotifyAll();
}

void ReconstructionDriver::Wake() {
  {
    const MutexLock lock(mutex_);
    has_news_ = true;
  }
  wake_.NotifyAll();
}

bool ReconstructionDriver::WaitForNews() {
  MutexLock lock(mutex_);
  if (!stopping_ && !has_news_) wake_.WaitFor(lock, kLookAgain);
  has_news_ = false;
  return !stopping_;
}

bool ReconstructionDriver::WaitToRetry() {
  const Stopwatch waited;
  const absl::Duration delay = absl::FromChrono(kRetryDelay);
  MutexLock lock(mutex_);
  while (!stopping_ && waited.Elapsed() < delay) {
    wake_.WaitFor(lock, absl::ToChronoNanoseconds(delay - waited.Elapsed()));
  }
  return !stopping_;
}

absl::Status ReconstructionDriver::SetState(ReconstructionState state, const std::string& reason) {
  const absl::Status status =
      environment_.store->SetReconstructionState(id_, state, ToUtf8(reason), environment_.clock->Now(), epoch_);
  changed_(false);
  // Cancelled or deleted meanwhile.
  return absl::IsFailedPrecondition(status) || absl::IsNotFound(status) ? Stopped() : status;
}

void ReconstructionDriver::Run() {
  for (int failures = 1;; ++failures) {
    const absl::Status status = ConductOrFail();
    {
      const MutexLock lock(mutex_);
      // Aborted: somebody else conducts it now.
      if (status.ok() || stopping_ || absl::IsCancelled(status) || absl::IsAborted(status)) return;
    }
    if (IsPermanent(status) || failures == kMaxFailures) {
      SetState(ReconstructionState::kFailed, std::string(status.message())).IgnoreError();
      return;
    }
    if (!WaitToRetry()) return;
  }
}

// Whatever a reconstruction's data does, it fails alone: the others of this process go on.
absl::Status ReconstructionDriver::ConductOrFail() {
  try {
    return Conduct();
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError("the coordinator has not enough memory for it");
  } catch (const std::exception& error) {
    return absl::FailedPreconditionError(absl::StrCat("cannot be processed: ", error.what()));
  }
}

absl::Status ReconstructionDriver::Conduct() {
  if (is_deleting_) return DeleteEverything();
  MW_ASSIGN_OR_RETURN(record_, environment_.store->GetReconstruction(id_));
  if (IsFinal(record_.state) || record_.state == ReconstructionState::kDeleting) return absl::OkStatus();
  MW_ASSIGN_OR_RETURN(const ReconstructionConfig config, environment_.parse_config(record_.options_json));
  MW_RETURN_IF_ERROR(PrepareScene(config));
  MW_ASSIGN_OR_RETURN(const std::unique_ptr<OuterLoop> loop, OpenLoop(config));
  MW_RETURN_IF_ERROR(SetState(ReconstructionState::kRunning));
  environment_.jobs_changed();
  MW_RETURN_IF_ERROR(RunJobs(*loop));
  return Join(config, *loop);
}

absl::Status ReconstructionDriver::DeleteEverything() {
  MW_ASSIGN_OR_RETURN(const std::vector<std::string> blobs, environment_.store->MarkBlobsForDeletion(id_));
  for (const std::string& digest : blobs) {
    MW_RETURN_IF_ERROR(environment_.blobs->Delete(digest));
    const MutexLock lock(mutex_);
    if (stopping_) return Stopped();
  }
  return environment_.store->DeleteReconstruction(id_);
}

absl::StatusOr<ReconstructionDriver::SceneFolder> ReconstructionDriver::FindSceneFolder() {
  if (!record_.scene_reference.empty()) {
    absl::StatusOr<std::string> path = ResolveSceneReference(record_.scene_reference, folders_.scene_roots);
    if (!path.ok()) return BadInput(path.status());
    return SceneFolder{.path = *std::move(path)};
  }
  std::string path = absl::StrCat(folders_.data, "/uploads/", id_, "-", epoch_);
  MW_ASSIGN_OR_RETURN(const std::vector<SceneFile> files, environment_.store->ListSceneFiles(id_));
  MW_RETURN_IF_ERROR(MaterializeScene(files, *environment_.blobs, path));
  return SceneFolder{.path = std::move(path), .is_temporary = true};
}

absl::Status ReconstructionDriver::RequestEstimation(const std::vector<PhotographFile>& photographs) {
  std::vector<StoredPhotograph> stored;
  for (const PhotographFile& photograph : photographs) {
    MW_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(photograph.local_path));
    MW_ASSIGN_OR_RETURN(const std::string digest, referenced_blobs_.Put(bytes));
    stored.push_back({.path = photograph.path, .digest = digest});
  }
  const CameraAssignment job = {.sequence = kCameraEstimation,
                                .camera = kCameraEstimation,
                                .memory_bytes = kEstimationBytes,
                                .spec = EncodePhotographs(stored)};
  MW_RETURN_IF_ERROR(environment_.store->Advance(id_, {}, {job}, {}, environment_.clock->Now(), epoch_));
  environment_.jobs_changed();
  return absl::OkStatus();
}

absl::Status ReconstructionDriver::WaitFor(SequenceNumber preparation) {
  while (true) {
    const absl::StatusOr<CameraJob> job = environment_.store->GetCameraJob(id_, preparation);
    if (absl::IsNotFound(job.status())) return absl::OkStatus();
    MW_RETURN_IF_ERROR(job.status());
    if (job->state != CameraJobState::kAssigned) return absl::OkStatus();
    changed_(false);
    if (!WaitForNews()) return Stopped();
  }
}

absl::StatusOr<std::optional<Scene>> ReconstructionDriver::ReadOrEstimate(const std::string& folder) {
  std::vector<PhotographFile> photographs;
  if (!HoldsScene(folder)) {
    MW_ASSIGN_OR_RETURN(photographs, environment_.list_photographs(folder));
  }
  if (photographs.empty()) {
    MW_ASSIGN_OR_RETURN(Scene scene, ReadScene(folder));
    return scene;
  }
  const absl::StatusOr<CameraJob> job = environment_.store->GetCameraJob(id_, kCameraEstimation);
  if (absl::IsNotFound(job.status())) {
    MW_RETURN_IF_ERROR(RequestEstimation(photographs));
    return std::nullopt;
  }
  MW_RETURN_IF_ERROR(job.status());
  if (job->state == CameraJobState::kAssigned) return std::nullopt;
  if (job->state == CameraJobState::kSkipped) return BadInput(absl::FailedPreconditionError(job->skip_reason));
  MW_ASSIGN_OR_RETURN(const std::string bytes, environment_.blobs->Get(job->filtered_digest));
  MW_ASSIGN_OR_RETURN(Scene scene, DecodeScene(bytes));
  for (SceneView& view : scene.views) {
    MW_RETURN_IF_ERROR(ValidateRelativePath(view.image_path));
    view.image_path = absl::StrCat(folder, "/", view.image_path);
  }
  return scene;
}

absl::Status ReconstructionDriver::RequestRefinement(const std::string& given_scene_blob) {
  const absl::Status known = environment_.store->GetCameraJob(id_, kCameraRefinement).status();
  if (absl::IsNotFound(known)) {
    const CameraAssignment job = {.sequence = kCameraRefinement,
                                  .camera = kCameraRefinement,
                                  .memory_bytes = kRefinementBytes,
                                  .spec = given_scene_blob};
    MW_RETURN_IF_ERROR(environment_.store->Advance(id_, {}, {job}, {}, environment_.clock->Now(), epoch_));
    environment_.jobs_changed();
  } else if (!known.ok()) {
    return known;
  }
  return absl::OkStatus();
}

absl::StatusOr<std::optional<std::string>> ReconstructionDriver::RefinedSceneBlob(const std::string& given_scene_blob) {
  const absl::StatusOr<CameraJob> job = environment_.store->GetCameraJob(id_, kCameraRefinement);
  if (absl::IsNotFound(job.status())) return given_scene_blob;
  MW_RETURN_IF_ERROR(job.status());
  // Who could not refine them says so in the job; they are used as they are.
  if (job->state == CameraJobState::kSkipped) return given_scene_blob;
  if (job->state == CameraJobState::kAssigned) {
    if (job->expected_digest.empty() || job->failed_attempts < environment_.max_failures) return std::nullopt;
    return absl::DataLossError(
        absl::StrCat("the refined cameras are damaged or lost and cannot be made again: ", job->last_failure));
  }
  const absl::StatusOr<std::string> text = environment_.blobs->Get(job->filtered_digest);
  if (IsBlobLost(text.status())) {
    MW_RETURN_IF_ERROR(environment_.store->ReopenCameraJob(
        id_, kCameraRefinement, job->epoch, job->filtered_digest,
        absl::StrCat("the refined cameras are damaged or lost (blob ", job->filtered_digest, ")"), absl::UnixEpoch(),
        epoch_));
    environment_.jobs_changed();
    return std::nullopt;
  }
  MW_RETURN_IF_ERROR(text.status());
  MW_ASSIGN_OR_RETURN(const CameraRefinement refinement, DecodeCameraRefinement(*text));
  if (!refinement.moved()) return given_scene_blob;
  MW_ASSIGN_OR_RETURN(const std::string bytes, environment_.blobs->Get(given_scene_blob));
  MW_ASSIGN_OR_RETURN(Scene scene, DecodeScene(bytes));
  MW_RETURN_IF_ERROR(ApplyRefinement(refinement, scene));
  return referenced_blobs_.Put(EncodeScene(scene));
}

// Until it is known.
absl::StatusOr<std::string> ReconstructionDriver::WaitForRefinedSceneBlob(const std::string& given_scene_blob) {
  while (true) {
    MW_ASSIGN_OR_RETURN(const std::optional<std::string> refined, RefinedSceneBlob(given_scene_blob));
    if (refined.has_value()) return *refined;
    MW_RETURN_IF_ERROR(WaitFor(kCameraRefinement));
  }
}

absl::StatusOr<std::optional<IngestedScene>> ReconstructionDriver::Take() {
  MW_ASSIGN_OR_RETURN(const SceneFolder folder, FindSceneFolder());
  const auto take = [&]() -> absl::StatusOr<std::optional<IngestedScene>> {
    const std::string root = folder.is_temporary ? folder.path : SceneRootOf(folder.path, folders_.scene_roots);
    MW_RETURN_IF_ERROR(CheckConfined(folder.path, root));
    MW_ASSIGN_OR_RETURN(std::optional<Scene> scene, ReadOrEstimate(folder.path));
    if (!scene.has_value()) return std::nullopt;
    return IngestScene(*std::move(scene), folder.path, root, referenced_blobs_, *environment_.pool);
  };
  absl::StatusOr<std::optional<IngestedScene>> taken = take();
  std::error_code error;
  if (folder.is_temporary) fs::remove_all(folder.path, error);
  return taken;
}

absl::Status ReconstructionDriver::PrepareScene(const ReconstructionConfig& config) {
  if (record_.scene_blob.empty()) {
    std::optional<IngestedScene> taken;
    while (!taken.has_value()) {
      MW_RETURN_IF_ERROR(WaitFor(kCameraEstimation));
      MW_ASSIGN_OR_RETURN(taken, Take());
    }
    if (config.refine_cameras > 0) {
      MW_RETURN_IF_ERROR(RequestRefinement(taken->scene_blob));
      MW_ASSIGN_OR_RETURN(taken->scene_blob, WaitForRefinedSceneBlob(taken->scene_blob));
    }
    MW_RETURN_IF_ERROR(environment_.store->SetReconstructionScene(id_, taken->scene_digest, taken->scene_blob, epoch_));
    record_.scene_blob = taken->scene_blob;
  }
  absl::StatusOr<std::string> bytes = environment_.blobs->Get(record_.scene_blob);
  if (IsBlobLost(bytes.status())) {
    MW_ASSIGN_OR_RETURN(const std::optional<IngestedScene> taken, Take());
    if (taken.has_value()) MW_RETURN_IF_ERROR(WaitForRefinedSceneBlob(taken->scene_blob).status());
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

absl::StatusOr<std::unique_ptr<OuterLoop>> ReconstructionDriver::OpenLoop(const ReconstructionConfig& config) {
  const OuterLoopEnvironment environment = {.store = environment_.store,
                                            .blobs = environment_.blobs,
                                            .clock = environment_.clock,
                                            .pool = environment_.pool,
                                            .max_failures = environment_.max_failures};
  MW_ASSIGN_OR_RETURN(std::unique_ptr<OuterLoop> loop,
                      OuterLoop::Open(environment, id_, epoch_, cameras_, points_, config));
  loop->SetRepairOther([this](const std::string& digest) { return RepairScene(digest); });
  return loop;
}

absl::Status ReconstructionDriver::RunJobs(OuterLoop& loop) {
  while (true) {
    MW_ASSIGN_OR_RETURN(const OuterLoop::Progress progress, loop.Step());
    if (progress.has_new_jobs) environment_.jobs_changed();
    changed_(false);
    if (progress.finished) return absl::OkStatus();
    if (!WaitForNews()) return Stopped();
  }
}

absl::Status ReconstructionDriver::Repair(OuterLoop& loop, const std::string& digest) {
  while (true) {
    MW_ASSIGN_OR_RETURN(const bool is_there, loop.Repair(digest));
    if (is_there) return absl::OkStatus();
    environment_.jobs_changed();
    if (!WaitForNews()) return Stopped();
  }
}

// The scene is read again, as long as it is there; it must be the same.
absl::StatusOr<bool> ReconstructionDriver::RepairScene(const std::string& digest) {
  const auto photograph = photographs_.find(digest);
  if (photograph == photographs_.end() && digest != record_.scene_blob) {
    return absl::NotFoundError(absl::StrCat("blob ", digest, " is none of reconstruction ", id_));
  }
  const std::string what = photograph == photographs_.end() ? "the scene's cameras and points"
                                                            : absl::StrCat("photograph ", photograph->second);
  const absl::StatusOr<std::optional<IngestedScene>> taken = Take();
  if (taken.ok() && taken->has_value()) {
    MW_ASSIGN_OR_RETURN(const std::optional<std::string> refined, RefinedSceneBlob((*taken)->scene_blob));
    if (!refined.has_value()) return false;  // being made again
    if (*refined == record_.scene_blob) return true;
  }
  if (!taken.ok() && !IsPermanent(taken.status()) && !absl::IsNotFound(taken.status())) return taken.status();
  return absl::DataLossError(
      absl::StrCat(what, " is damaged or lost (blob ", digest, "), and cannot be read again: ",
                   taken.ok() ? std::string("the scene is not what it was") : std::string(taken.status().message())));
}

absl::Status ReconstructionDriver::Join(const ReconstructionConfig& config, OuterLoop& loop) {
  MW_RETURN_IF_ERROR(SetState(ReconstructionState::kJoining));
  const absl::Status nothing = BadInput(absl::FailedPreconditionError(
      absl::StrCat("nothing was reconstructed: no surface was supported by ", config.conductor.acceptance.k_a,
                   " other cameras; are the cameras right, and do the photographs show the same surface?")));
  if (loop.conductor().AcceptedSurfaces().empty()) return nothing;
  MW_ASSIGN_OR_RETURN(const StoredMesh mesh, WriteMesh(config, loop));
  if (mesh.faces == 0) return nothing;
  const absl::Status finished = environment_.store->FinishReconstruction(id_, mesh, environment_.clock->Now(), epoch_);
  return absl::IsFailedPrecondition(finished) ? Stopped() : finished;
}

absl::StatusOr<JoinedMeshCounts> ReconstructionDriver::TryToWriteMesh(const ReconstructionConfig& config,
                                                                      const Conductor& conductor,
                                                                      const std::string& path, JudgedSurfaces& judged) {
  LostBlobNamer blobs(*environment_.blobs);
  const auto put = [&](const std::string& bytes) { return referenced_blobs_.Put(bytes); };
  const ForecastInput forecast = conductor.ForecastNow();
  JoiningProgress joining(forecast.judging_seconds, forecast.joining_seconds, *environment_.clock);
  Stopwatch since_told(*environment_.clock);
  const auto tell = [&] {
    if (since_told.Elapsed() < kTellEvery) return;
    since_told = Stopwatch(*environment_.clock);
    TellJoining(joining, conductor);
  };
  const std::vector<CommittedSurface> committed = conductor.CommittedSurfaces();
  MW_ASSIGN_OR_RETURN(
      judged,
      JudgeCommittedSurfaces(committed, config.conductor.acceptance, blobs, put, *environment_.pool, [&](int done) {
        joining.SetJudged(static_cast<double>(done) / static_cast<double>(committed.size()));
        tell();
      }));
  return WriteAcceptedMesh(judged.surfaces, blobs, config.join, offset_, path, *environment_.pool, [&](double share) {
    joining.SetJoined(share);
    tell();
  });
}

// Whether it arrives matters little; the end of the mesh is written by other means.
void ReconstructionDriver::TellJoining(const JoiningProgress& joining, const Conductor& conductor) {
  const absl::Time now = environment_.clock->Now();
  Progress progress = conductor.progress();
  progress.joined_thousandths = static_cast<int64_t>(kThousandths * joining.share());
  if (joining.seconds_left() >= 0) progress.expected_end = now + absl::Seconds(joining.seconds_left());
  environment_.store->Advance(id_, {}, {}, progress, now, epoch_).IgnoreError();
  changed_(false);
}

absl::StatusOr<StoredMesh> ReconstructionDriver::WriteMesh(const ReconstructionConfig& config, OuterLoop& loop) {
  const std::string path = absl::StrCat(folders_.data, "/meshes/", id_, "-", epoch_, ".new");
  JudgedSurfaces judged;
  absl::StatusOr<JoinedMeshCounts> counts = absl::UnknownError("not tried");
  for (int attempt = 0; attempt < kMaxRepairsInARow && !counts.ok(); ++attempt) {
    judged = {};
    counts = TryToWriteMesh(config, loop.conductor(), path, judged);
    if (counts.ok()) break;
    const std::string lost = LostBlobOf(counts.status());
    if (lost.empty()) return counts.status();
    // What was judged is judged again with the next attempt; all else has its source.
    const bool is_judged = std::any_of(judged.surfaces.begin(), judged.surfaces.end(),
                                       [&](const AcceptedSurface& surface) { return surface.digest == lost; });
    if (!is_judged) MW_RETURN_IF_ERROR(Repair(loop, lost));
  }
  MW_RETURN_IF_ERROR(counts.status());
  MW_ASSIGN_OR_RETURN(const FileFacts facts, FactsOf(path));
  MW_RETURN_IF_ERROR(referenced_blobs_.PutFile(path, facts.sha256));
  std::error_code error;
  fs::rename(path, folders_.MeshFile(facts.sha256), error);
  return StoredMesh{.digest = facts.sha256,
                    .bytes = facts.bytes,
                    .vertices = counts->vertices,
                    .faces = counts->faces,
                    .verdict_json = MakeVerdict(judged)};
}

// The mesh is there: whatever keeps a verdict from being given does not take it away.
std::string ReconstructionDriver::MakeVerdict(const JudgedSurfaces& judged) const {
  if (!environment_.make_verdict) return "";
  return environment_.make_verdict(id_, judged.cameras).value_or("");
}

}  // namespace meshwright
