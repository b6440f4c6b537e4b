#include "coordinator/api/conducted_reconstruction.h"

#include <algorithm>
#include <chrono>
#include <filesystem>

#include <absl/strings/str_cat.h>

#include "common/base/bad_input.h"
#include "common/base/digest.h"
#include "common/base/files.h"
#include "common/base/status_macros.h"
#include "common/scene/scene_codec.h"
#include "common/scene/view.h"
#include "coordinator/api/scene_intake.h"
#include "coordinator/conductor/accepted_mesh.h"

namespace meshwright {
namespace {

// Errors of the store and the blobs (a full disk, a server that is away) are waited out for some minutes.
constexpr int kMaxTroubles = 12;
constexpr std::chrono::seconds kTroubleDelay(10);

bool IsFinal(const absl::Status& status) {
  return IsBadInput(status) || absl::IsInvalidArgument(status) || absl::IsFailedPrecondition(status);
}

absl::Status Stopped() { return absl::CancelledError("stopped"); }

struct FileFacts {
  int64_t bytes = 0;
  std::string sha256;
};

absl::StatusOr<FileFacts> FactsOf(const std::string& path) {
  std::FILE* const file = std::fopen(path.c_str(), "rb");
  if (file == nullptr) return absl::NotFoundError(absl::StrCat(path, ": cannot be read"));
  std::vector<uint8_t> buffer(size_t{1} << 20);
  Sha256Stream digest;
  FileFacts facts;
  while (const size_t count = std::fread(buffer.data(), 1, buffer.size(), file)) {
    digest.Update(absl::MakeConstSpan(buffer.data(), count));
    facts.bytes += static_cast<int64_t>(count);
  }
  std::fclose(file);
  facts.sha256 = digest.HexDigest();
  return facts;
}

}  // namespace

ConductedReconstruction::ConductedReconstruction(const ConductingEnvironment& environment,
                                                 const ReconstructionRecord& record, std::string scene_folder,
                                                 std::string mesh_path, Update update, std::function<void()> changed)
    : environment_(environment),
      record_(record),
      scene_folder_(std::move(scene_folder)),
      mesh_path_(std::move(mesh_path)),
      update_(std::move(update)),
      changed_(std::move(changed)) {
  thread_ = std::thread([this] { Run(); });
}

ConductedReconstruction::~ConductedReconstruction() {
  RequestStop();
  thread_.join();
}

void ConductedReconstruction::RequestStop() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
}

ConductedReconstruction::Snapshot ConductedReconstruction::snapshot() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return snapshot_;
}

absl::Status ConductedReconstruction::Change(const std::function<void(ReconstructionRecord&)>& change) {
  MW_ASSIGN_OR_RETURN(const bool still_wanted, update_(change));
  if (!still_wanted) return Stopped();
  change(record_);
  return absl::OkStatus();
}

void ConductedReconstruction::Run() {
  for (int troubles = 1;; ++troubles) {
    const absl::Status status = Conduct();
    environment_.workers->RemoveReconstruction(record_.id);
    {
      std::unique_lock<std::mutex> lock(mutex_);
      if (status.ok() || stopping_ || absl::IsCancelled(status)) return;
      outcomes_.clear();
    }
    handed_out_.clear();
    if (IsFinal(status) || troubles == kMaxTroubles) {
      (void)update_([&](ReconstructionRecord& record) {
        record.state = v1::RECONSTRUCTION_STATE_FAILED;
        record.failure = std::string(status.message());
        record.finished = environment_.clock->Now();
      });
      return;
    }
    std::unique_lock<std::mutex> lock(mutex_);
    wake_.wait_for(lock, kTroubleDelay, [&] { return stopping_; });
  }
}

absl::Status ConductedReconstruction::Conduct() {
  MW_ASSIGN_OR_RETURN(const Method method, environment_.parse_method(record_.options_json));
  MW_RETURN_IF_ERROR(PrepareScene(method));
  absl::StatusOr<std::unique_ptr<Conductor>> conductor =
      Conductor::Open(record_.id, cameras_, points_, method.conductor, environment_.store, environment_.blobs,
                      environment_.clock, environment_.pool);
  if (absl::IsFailedPrecondition(conductor.status())) return BadInput(conductor.status());
  MW_RETURN_IF_ERROR(conductor.status());
  MW_RETURN_IF_ERROR(Change([](ReconstructionRecord& record) { record.state = v1::RECONSTRUCTION_STATE_RUNNING; }));
  environment_.workers->AddReconstruction(record_.id, {.weight = record_.weight,
                                                       .options_json = record_.options_json,
                                                       .scene_digest = record_.scene_blob,
                                                       .sink = [this](JobOutcome outcome) {
                                                         {
                                                           const std::lock_guard<std::mutex> lock(mutex_);
                                                           outcomes_.push_back(std::move(outcome));
                                                         }
                                                         wake_.notify_all();
                                                       }});
  MW_RETURN_IF_ERROR(RunJobs(method, **conductor));
  return Join(method, **conductor);
}

absl::Status ConductedReconstruction::PrepareScene(const Method& method) {
  if (record_.scene_blob.empty()) {
    MW_ASSIGN_OR_RETURN(const TakenScene taken, TakeScene(scene_folder_, *environment_.blobs, *environment_.pool));
    const absl::Status created = environment_.store->CreateReconstruction(
        {.id = record_.id, .options_json = record_.options_json, .scene_digest = taken.scene_digest},
        environment_.clock->Now());
    if (!absl::IsAlreadyExists(created)) MW_RETURN_IF_ERROR(created);
    MW_RETURN_IF_ERROR(Change([&](ReconstructionRecord& record) { record.scene_blob = taken.scene_blob; }));
  }
  MW_ASSIGN_OR_RETURN(const std::string bytes, environment_.blobs->Get(record_.scene_blob));
  MW_ASSIGN_OR_RETURN(Scene scene, DecodeScene(bytes));
  cameras_.clear();
  for (const SceneView& view : scene.views) cameras_.push_back(UndistortedCamera(view, method.max_image_size));
  points_ = std::move(scene.points);
  return absl::OkStatus();
}

void ConductedReconstruction::PublishProgress(const Conductor& conductor) {
  Snapshot snapshot = {.progress = conductor.progress()};
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    snapshot.pairs = std::move(snapshot_.pairs);
    snapshot_ = std::move(snapshot);
  }
  changed_();
}

void ConductedReconstruction::OfferJobs(const Method& method, Conductor& conductor) {
  for (CameraJobSpec& spec : conductor.TakeJobs()) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      for (const CameraIndex target : spec.neighbours) snapshot_.pairs.emplace_back(spec.camera, target);
    }
    handed_out_[spec.sequence] = spec;
    const int64_t bytes = method.job_bytes(spec, cameras_);
    environment_.workers->Offer(record_.id, std::move(spec), bytes, absl::InfinitePast());
  }
}

bool ConductedReconstruction::WaitForOutcome(JobOutcome& outcome) {
  std::unique_lock<std::mutex> lock(mutex_);
  wake_.wait(lock, [&] { return stopping_ || !outcomes_.empty(); });
  if (stopping_) return false;
  outcome = std::move(outcomes_.front());
  outcomes_.pop_front();
  return true;
}

absl::Status ConductedReconstruction::RunJobs(const Method& method, Conductor& conductor) {
  while (true) {
    OfferJobs(method, conductor);
    PublishProgress(conductor);
    if (conductor.finished()) return absl::OkStatus();
    JobOutcome outcome;
    if (!WaitForOutcome(outcome)) return Stopped();
    MW_RETURN_IF_ERROR(Handle(method, conductor, outcome));
  }
}

absl::Status ConductedReconstruction::Handle(const Method& method, Conductor& conductor, const JobOutcome& outcome) {
  Attempts& attempts = attempts_[outcome.sequence];
  JobOutcome failed = outcome;
  const auto delay_after = [&](int attempt) {
    return std::min(environment_.retry.backoff * (int64_t{1} << std::min(attempt - 1, 20)),
                    environment_.retry.max_backoff);
  };
  switch (outcome.kind) {
    case JobOutcome::Kind::kFinished: {
      const absl::Status status = conductor.Complete(outcome.sequence, outcome.epoch, outcome.filtered_digest,
                                                     outcome.weak_targets, outcome.report_json);
      if (status.ok() || absl::IsAborted(status)) return absl::OkStatus();
      // The worker's word is not to be relied upon: weak targets that are none, a surface that is not there.
      if (!absl::IsInvalidArgument(status) && !absl::IsFailedPrecondition(status)) return status;
      failed.reason = std::string(status.message());
      break;
    }
    case JobOutcome::Kind::kGivenBack:
      return TryAgain(method, outcome, absl::ZeroDuration());
    case JobOutcome::Kind::kLost:
      if (++attempts.losses < environment_.retry.max_losses) {
        return TryAgain(method, outcome,
                        attempts.losses == 1 ? absl::ZeroDuration() : delay_after(attempts.losses - 1));
      }
      failed.reason = absl::StrCat("lost ", attempts.losses, " workers, the last one: ", outcome.reason);
      attempts.failures = environment_.retry.max_failures - 1;
      break;
    case JobOutcome::Kind::kFailed:
      break;
  }
  if (++attempts.failures < environment_.retry.max_failures) {
    return TryAgain(method, failed, delay_after(attempts.failures));
  }
  const absl::Status status = conductor.SetAside(outcome.sequence, outcome.epoch, failed.reason);
  return absl::IsAborted(status) ? absl::OkStatus() : status;
}

absl::Status ConductedReconstruction::TryAgain(const Method& method, const JobOutcome& outcome, absl::Duration delay) {
  const auto found = handed_out_.find(outcome.sequence);
  if (found == handed_out_.end() || found->second.epoch != outcome.epoch) return absl::OkStatus();
  CameraJobSpec& spec = found->second;
  const absl::Time now = environment_.clock->Now();
  MW_ASSIGN_OR_RETURN(spec.epoch, environment_.store->ReassignCameraJob(record_.id, spec.sequence, now));
  environment_.workers->Offer(record_.id, spec, method.job_bytes(spec, cameras_), now + delay);
  return absl::OkStatus();
}

absl::Status ConductedReconstruction::Join(const Method& method, const Conductor& conductor) {
  MW_RETURN_IF_ERROR(Change([](ReconstructionRecord& record) { record.state = v1::RECONSTRUCTION_STATE_JOINING; }));
  const std::vector<AcceptedSurface> surfaces = conductor.AcceptedSurfaces();
  if (surfaces.empty()) {
    return BadInput(absl::FailedPreconditionError(
        absl::StrCat("nothing was reconstructed: no surface was supported by ", method.conductor.acceptance.k_a,
                     " other cameras; are the cameras right, and do the photographs show the same surface?")));
  }
  MW_ASSIGN_OR_RETURN(const JoinedMeshCounts counts,
                      WriteAcceptedMesh(surfaces, *environment_.blobs, method.join, mesh_path_, *environment_.pool));
  MW_ASSIGN_OR_RETURN(const FileFacts facts, FactsOf(mesh_path_));
  return Change([&](ReconstructionRecord& record) {
    record.state = v1::RECONSTRUCTION_STATE_DONE;
    record.mesh_bytes = facts.bytes;
    record.mesh_sha256 = facts.sha256;
    record.vertices = counts.vertices;
    record.faces = counts.faces;
    record.finished = environment_.clock->Now();
  });
}

}  // namespace meshwright
