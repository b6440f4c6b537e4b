// SPDX-License-Identifier: Apache-2.0
#include "coordinator/api/reconstruction_service.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <set>
#include <utility>

#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"
#include "common/scene/scene_codec.h"
#include "coordinator/api/public_text.h"
#include "coordinator/auth/gatekeeper.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

constexpr int kDefaultPageSize = 100;
constexpr int kMaxPageSize = 1000;
constexpr double kMinWeight = 0.001;
constexpr double kMaxWeight = 1000;
constexpr std::chrono::milliseconds kLookAgain(500);

constexpr int kDefaultAttempts = 1000;
constexpr int kMaxAttempts = 100'000;
// The overseer looks so often in the time of a lease.
constexpr int kLooksPerLease = 4;

absl::Status WrongState(const Reconstruction& stored, const char* expected) {
  return absl::FailedPreconditionError(
      absl::StrCat("reconstruction ", stored.id, " is ", InWords(ToProto(stored.state)), ", expected ", expected));
}

v1::CameraState CameraStateOf(CameraJobState state, bool committed, bool is_over) {
  if (state == CameraJobState::kSkipped) return v1::CAMERA_STATE_SKIPPED;
  if (committed) return v1::CAMERA_STATE_COMMITTED;
  // Nobody is at what was cancelled, or has failed, and nobody will be.
  if (is_over) return v1::CAMERA_STATE_WAITING;
  return state == CameraJobState::kDone ? v1::CAMERA_STATE_DONE : v1::CAMERA_STATE_ASSIGNED;
}

void FillPart(const Commit& commit, v1::Part& part) {
  part.set_sequence(commit.sequence);
  part.set_camera(commit.camera);
  part.set_sha256(commit.accepted_digest);
  part.set_patches(commit.accepted_patches);
}

}  // namespace

bool IsOver(v1::ReconstructionState state) {
  return state == v1::RECONSTRUCTION_STATE_DONE || state == v1::RECONSTRUCTION_STATE_FAILED ||
         state == v1::RECONSTRUCTION_STATE_CANCELLED;
}

ReconstructionService::ReconstructionService(const ReconstructionServiceOptions& options,
                                             const DriverEnvironment& environment, WorkerService& workers)
    : options_(options),
      folders_{.data = options.data_folder, .scene_roots = options.scene_roots},
      environment_(environment),
      workers_(workers) {}

absl::StatusOr<std::unique_ptr<ReconstructionService>> ReconstructionService::Open(
    const ReconstructionServiceOptions& options, const DriverEnvironment& environment, WorkerService& workers) {
  for (const char* folder : {"uploads", "meshes"}) {
    std::error_code error;
    fs::create_directories(fs::path(options.data_folder) / folder, error);
    if (error) {
      return absl::PermissionDeniedError(
          absl::StrCat(options.data_folder, "/", folder, ": cannot make the folder: ", error.message()));
    }
  }
  auto service = std::unique_ptr<ReconstructionService>(new ReconstructionService(options, environment, workers));
  workers.SetListener([raw = service.get()](const std::string& id) {
    if (!raw->WakeConductor(id)) raw->options_.tell_others({StoreNews::About::kResults, id});
  });
  service->overseer_ = std::thread([raw = service.get()] { raw->Oversee(); });
  return service;
}

ReconstructionService::~ReconstructionService() {
  Shutdown();
  workers_.SetListener(nullptr);
  overseer_.join();
  // All end at the same time; then others may take over at once.
  for (auto& [id, conducted] : conducted_) conducted->RequestStop();
  const absl::Time now = environment_.store->Now().value_or(environment_.clock->Now());
  for (auto& [id, conducted] : conducted_) {
    HeldConductorLease lease = conducted->lease();
    conducted.reset();
    lease.Release(now).IgnoreError();
  }
}

void ReconstructionService::Changed(bool look) {
  {
    const MutexLock lock(mutex_);
    ++version_;
    look_ = look_ || look;
  }
  changed_.NotifyAll();
  if (look) overseer_wake_.NotifyAll();
}

bool ReconstructionService::WakeConductor(const std::string& id) {
  const MutexLock lock(mutex_);
  const auto found = conducted_.find(id);
  if (found == conducted_.end()) return false;
  found->second->Wake();
  return true;
}

void ReconstructionService::Hear(const StoreNews& news) {
  if (news.about == StoreNews::About::kResults) {
    WakeConductor(news.reconstruction);
    return;
  }
  workers_.Wake();
  if (news.about == StoreNews::About::kJobs) return;
  Changed(/*look=*/true);
  if (news.about == StoreNews::About::kStates) return;
  const MutexLock lock(mutex_);
  for (auto& [id, conducted] : conducted_) conducted->Wake();
}

void ReconstructionService::Oversee() {
  const auto every = absl::ToChronoNanoseconds(options_.conductor_lease / kLooksPerLease);
  MutexLock lock(mutex_);
  while (!stopping_) {
    look_ = false;
    lock.Unlock();
    // A store that is away comes back, or everything else fails too.
    OverseeOnce().IgnoreError();
    lock.Lock();
    if (!stopping_ && !look_) overseer_wake_.WaitFor(lock, every);
  }
}

absl::Status ReconstructionService::OverseeOnce() {
  MW_ASSIGN_OR_RETURN(const absl::Time now, environment_.store->Now());
  MW_ASSIGN_OR_RETURN(const std::vector<ConductedState> all, environment_.store->ListConducted());
  std::map<std::string, const ConductedState*> by_id;
  for (const ConductedState& state : all) by_id[state.id] = &state;
  std::vector<std::unique_ptr<ReconstructionDriver>> ended;
  std::vector<std::string> ended_ids;
  {
    const MutexLock lock(mutex_);
    for (auto it = conducted_.begin(); it != conducted_.end();) {
      ReconstructionDriver& conducted = *it->second;
      const auto found = by_id.find(it->first);
      const bool is_ours = found != by_id.end() && found->second->lease.epoch == conducted.lease().epoch();
      if (!is_ours) conducted.RequestStop();  // cancelled, or somebody else's now
      if (conducted.has_ended()) {
        ended.push_back(std::move(it->second));
        ended_ids.push_back(it->first);
        it = conducted_.erase(it);
      } else {
        ++it;
      }
    }
  }
  ended.clear();
  for (const std::string& id : ended_ids) TellEnd(id);
  for (auto it = others_.begin(); it != others_.end();) {
    it = by_id.count(it->first) > 0 ? std::next(it) : others_.erase(it);
  }
  for (const ConductedState& state : all) MW_RETURN_IF_ERROR(TakeUp(state, now));
  return absl::OkStatus();
}

absl::Status ReconstructionService::TakeUp(const ConductedState& state, absl::Time now) {
  const bool is_of_ours = state.method_version == options_.method_version;
  if (!is_of_ours && state.state != ReconstructionState::kDeleting) return absl::OkStatus();
  HeldConductorLease* held = nullptr;  // touched by this thread alone, as is what owns it
  {
    const MutexLock lock(mutex_);
    const auto found = conducted_.find(state.id);
    if (found != conducted_.end()) {
      ReconstructionDriver& conducted = *found->second;
      // What was run before it was deleted has to end first.
      if (state.state == ReconstructionState::kDeleting && !conducted.is_deleting()) conducted.RequestStop();
      held = &conducted.lease();
    }
  }
  if (held != nullptr) {
    const absl::Status renewed = held->RenewIfDue(now);
    return absl::IsAborted(renewed) ? absl::OkStatus() : renewed;
  }
  absl::Time lapsed_by = now;
  if (state.lease.epoch > 0 && state.lease.expires_at > now && state.lease.owner != options_.name) {
    if (!IsAbandoned(state)) return absl::OkStatus();
    lapsed_by = state.lease.expires_at;
  }
  absl::StatusOr<HeldConductorLease> lease = HeldConductorLease::Acquire(*environment_.store, state.id, options_.name,
                                                                         options_.conductor_lease, now, lapsed_by);
  // Another coordinator was quicker, or it is gone.
  if (absl::IsFailedPrecondition(lease.status()) || absl::IsNotFound(lease.status())) return absl::OkStatus();
  MW_RETURN_IF_ERROR(lease.status());
  const MutexLock lock(mutex_);
  conducted_[state.id] = std::make_unique<ReconstructionDriver>(environment_, folders_, state.id, *std::move(lease),
                                                                state.state == ReconstructionState::kDeleting,
                                                                [this](bool has_ended) { Changed(has_ended); });
  return absl::OkStatus();
}

bool ReconstructionService::IsAbandoned(const ConductedState& state) {
  const absl::Duration now = SystemClock().Uptime();
  SeenLease& seen = others_[state.id];
  if (seen.epoch != state.lease.epoch || seen.expires_at != state.lease.expires_at) {
    seen = {.epoch = state.lease.epoch, .expires_at = state.lease.expires_at, .since = now};
  }
  return now - seen.since > options_.conductor_lease;
}

void ReconstructionService::StopConducting(const std::string& id) {
  {
    const MutexLock lock(mutex_);
    const auto found = conducted_.find(id);
    if (found != conducted_.end()) found->second->RequestStop();
  }
  workers_.Wake();
  Changed(/*look=*/true);
  options_.tell_others({StoreNews::About::kStates, id});
}

void ReconstructionService::TellEnd(const std::string& id) {
  const absl::StatusOr<Reconstruction> stored = Find(id);
  if (stored.ok() && IsFinal(stored->state)) options_.ended(Describe(*stored));
}

absl::StatusOr<Reconstruction> ReconstructionService::Find(const std::string& id) const {
  const auto none = [&] { return NoSuchReconstruction(id); };
  if (!ValidateReconstructionId(id).ok()) return none();
  absl::StatusOr<Reconstruction> stored = environment_.store->GetReconstruction(id);
  if (absl::IsNotFound(stored.status())) return none();
  if (stored.ok() && stored->state == ReconstructionState::kDeleting) return none();
  return stored;
}

v1::Reconstruction ReconstructionService::Describe(const Reconstruction& stored) const {
  v1::Reconstruction reconstruction = ToProto(stored);
  if (IsFinal(stored.state)) return reconstruction;
  reconstruction.mutable_progress()->set_jobs_leased(workers_.LeasesIn(stored.id));
  if (stored.method_version != options_.method_version) {
    reconstruction.add_warnings(absl::StrCat("it was begun with version ", stored.method_version,
                                             " of the method, this coordinator has version ", options_.method_version,
                                             ": it waits for a coordinator of the program that began it"));
  }
  if (std::string stage = workers_.StageOf(stored.id); !stage.empty()) reconstruction.set_stage(std::move(stage));
  for (std::string& warning : workers_.WarningsFor(stored.id)) {
    reconstruction.add_warnings(std::move(warning));
  }
  return reconstruction;
}

absl::StatusOr<v1::Reconstruction> ReconstructionService::Create(const v1::CreateReconstructionRequest& request,
                                                                 const std::string& owner) {
  MW_RETURN_IF_ERROR(ValidateReconstructionId(request.id()));
  const double weight = request.weight() == 0 ? 1 : request.weight();
  if (!(weight >= kMinWeight && weight <= kMaxWeight)) {
    return absl::InvalidArgumentError(absl::StrCat("weight is ", request.weight(), ", expected 0..", kMaxWeight,
                                                   "; 0 stands for 1, other weights are at least ", kMinWeight));
  }
  MW_ASSIGN_OR_RETURN(const ReconstructionConfig config, environment_.parse_config(request.options_json()));
  if (!request.scene_reference().empty()) {
    MW_RETURN_IF_ERROR(ResolveSceneReference(request.scene_reference(), options_.scene_roots).status());
  }
  const Reconstruction wanted = {.id = request.id(),
                                 .options_json = config.options_json,
                                 .state = ReconstructionState::kCreated,
                                 .weight = std::round(weight / kMinWeight) * kMinWeight,
                                 .scene_reference = request.scene_reference(),
                                 .owner = owner,
                                 .method_version = options_.method_version};
  absl::StatusOr<Reconstruction> stored = Find(wanted.id);
  if (absl::IsNotFound(stored.status())) {
    MW_ASSIGN_OR_RETURN(const absl::Time now, environment_.store->Now());
    const absl::Status created = environment_.store->CreateReconstruction(wanted, now);
    // Another call, or another coordinator, may have been quicker.
    if (!created.ok() && !absl::IsAlreadyExists(created)) return created;
    stored = Find(wanted.id);
  }
  if (absl::IsNotFound(stored.status())) {
    return absl::AlreadyExistsError(
        absl::StrCat("id \"", wanted.id, "\" is that of a reconstruction that was deleted"));
  }
  MW_RETURN_IF_ERROR(stored.status());
  // What an earlier program wrote may say the same in other words.
  const absl::StatusOr<ReconstructionConfig> begun = environment_.parse_config(stored->options_json);
  const std::string& options = begun.ok() ? begun->options_json : stored->options_json;
  if (stored->owner != wanted.owner || options != wanted.options_json ||
      stored->scene_reference != wanted.scene_reference || std::abs(stored->weight - wanted.weight) > kMinWeight / 2) {
    return absl::AlreadyExistsError(absl::StrCat("id \"", wanted.id, "\" is that of another reconstruction"));
  }
  return Describe(*stored);
}

absl::Status ReconstructionService::CheckTakesFiles(const std::string& id) const {
  MW_ASSIGN_OR_RETURN(const Reconstruction stored, Find(id));
  if (stored.state != ReconstructionState::kCreated) return WrongState(stored, "one not started");
  if (stored.scene_reference.empty()) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("reconstruction ", stored.id, " has a scene_reference; nothing is uploaded to it"));
}

absl::StatusOr<v1::Reconstruction> ReconstructionService::CreateAgain(const std::string& source,
                                                                      v1::CreateReconstructionRequest request,
                                                                      const std::string& owner) {
  MW_ASSIGN_OR_RETURN(const Reconstruction from, Find(source));
  if (!request.scene_reference().empty()) {
    return absl::InvalidArgumentError("scene_reference is given, expected none: the scene is that of the other one");
  }
  request.set_scene_reference(from.scene_reference);
  MW_ASSIGN_OR_RETURN(v1::Reconstruction created, Create(request, owner));
  if (created.state() != v1::RECONSTRUCTION_STATE_CREATED) return created;
  MW_ASSIGN_OR_RETURN(const std::vector<SceneFile> files, environment_.store->ListSceneFiles(source));
  ReferencedBlobs blobs(created.id(), *environment_.store, *environment_.blobs);
  for (const SceneFile& file : files) {
    MW_RETURN_IF_ERROR(blobs.Hold(file.digest));
    MW_RETURN_IF_ERROR(environment_.store->PutSceneFile(created.id(), file));
  }
  return created;
}

absl::StatusOr<SceneFileUpload> ReconstructionService::BeginUpload(const v1::UploadSceneFileRequest::Header& header) {
  MW_RETURN_IF_ERROR(CheckTakesFiles(header.reconstruction_id()));
  return SceneFileUpload::Begin(
      staging_folder(), header.path(), header.size_bytes(), header.sha256(),
      [this, header](const std::string& staged_path) {
        return AdoptSceneFile(header.reconstruction_id(),
                              {.path = header.path(), .size_bytes = header.size_bytes(), .digest = header.sha256()},
                              staged_path);
      });
}

absl::Status ReconstructionService::AdoptSceneFile(const std::string& id, const SceneFile& file,
                                                   const std::string& staged_path) {
  MW_RETURN_IF_ERROR(CheckTakesFiles(id));
  MW_RETURN_IF_ERROR(ReferencedBlobs(id, *environment_.store, *environment_.blobs).Adopt(staged_path, file.digest));
  return environment_.store->PutSceneFile(id, file);
}

std::string ReconstructionService::staging_folder() const {
  const std::string folder = environment_.blobs->staging_folder();
  return folder.empty() ? absl::StrCat(options_.data_folder, "/uploads") : folder;
}

absl::StatusOr<std::vector<SceneFile>> ReconstructionService::ListSceneFiles(const std::string& id) const {
  MW_RETURN_IF_ERROR(Find(id).status());
  return environment_.store->ListSceneFiles(id);
}

absl::StatusOr<v1::Reconstruction> ReconstructionService::Start(const std::string& id) {
  MW_ASSIGN_OR_RETURN(Reconstruction stored, Find(id));
  if (stored.state == ReconstructionState::kCreated) {
    MW_ASSIGN_OR_RETURN(const absl::Time now, environment_.store->Now());
    MW_RETURN_IF_ERROR(environment_.store->RequestState(id, ReconstructionState::kPreparing, now));
    Changed(/*look=*/true);
    options_.tell_others({StoreNews::About::kStates, id});
    MW_ASSIGN_OR_RETURN(stored, Find(id));
  }
  if (stored.state == ReconstructionState::kCancelled) return WrongState(stored, "one not cancelled");
  return Describe(stored);
}

absl::StatusOr<v1::Reconstruction> ReconstructionService::Get(const std::string& id) const {
  MW_ASSIGN_OR_RETURN(const Reconstruction stored, Find(id));
  return Describe(stored);
}

absl::StatusOr<v1::ListReconstructionsResponse> ReconstructionService::List(
    const v1::ListReconstructionsRequest& request, const std::optional<std::string>& owner) const {
  if (request.page_size() < 0 || request.page_size() > kMaxPageSize) {
    return absl::InvalidArgumentError(
        absl::StrCat("page_size is ", request.page_size(), ", expected 0..", kMaxPageSize));
  }
  const int page_size = request.page_size() > 0 ? request.page_size() : kDefaultPageSize;
  // A page's token is the last id of the page before.
  if (!request.page_token().empty() && !ValidateReconstructionId(request.page_token()).ok()) {
    return absl::InvalidArgumentError("page_token: expected what the page before said");
  }
  JobStore& store = *environment_.store;
  MW_ASSIGN_OR_RETURN(const std::vector<Reconstruction> page,
                      owner ? store.ListReconstructionsOf(*owner, request.page_token(), page_size + 1)
                            : store.ListReconstructions(request.page_token(), page_size + 1));
  v1::ListReconstructionsResponse response;
  for (const Reconstruction& stored : page) {
    if (response.reconstructions_size() == page_size) {
      response.set_next_page_token(response.reconstructions(page_size - 1).id());
      break;
    }
    *response.add_reconstructions() = Describe(stored);
  }
  return response;
}

absl::StatusOr<v1::Reconstruction> ReconstructionService::Cancel(const std::string& id) {
  MW_ASSIGN_OR_RETURN(Reconstruction stored, Find(id));
  if (!IsFinal(stored.state)) {
    MW_ASSIGN_OR_RETURN(const absl::Time now, environment_.store->Now());
    const absl::Status cancelled = environment_.store->RequestState(id, ReconstructionState::kCancelled, now);
    // It may have come to its end at the same moment.
    if (!absl::IsFailedPrecondition(cancelled)) MW_RETURN_IF_ERROR(cancelled);
    const bool was_conducted = stored.state != ReconstructionState::kCreated;
    StopConducting(id);
    if (!was_conducted) TellEnd(id);
    MW_ASSIGN_OR_RETURN(stored, Find(id));
  }
  return Describe(stored);
}

absl::Status ReconstructionService::Delete(const std::string& id) {
  MW_ASSIGN_OR_RETURN(const Reconstruction stored, Find(id));
  MW_RETURN_IF_ERROR(environment_.store->BeginDeletion(id));
  if (!stored.mesh.digest.empty()) {
    std::error_code error;
    fs::remove(folders_.MeshFile(stored.mesh.digest), error);
  }
  StopConducting(id);
  return absl::OkStatus();
}

absl::StatusOr<Scene> ReconstructionService::LoadScene(const std::string& id) const {
  MW_ASSIGN_OR_RETURN(const Reconstruction stored, Find(id));
  if (stored.scene_blob.empty()) return WrongState(stored, "one whose scene has been checked");
  MW_ASSIGN_OR_RETURN(const std::string bytes, environment_.blobs->Get(stored.scene_blob));
  return DecodeScene(bytes);
}

absl::StatusOr<v1::ListCamerasResponse> ReconstructionService::ListCameras(const std::string& id) const {
  v1::ListCamerasResponse response;
  const absl::StatusOr<Scene> loaded = LoadScene(id);
  if (absl::IsFailedPrecondition(loaded.status())) return response;
  MW_RETURN_IF_ERROR(loaded.status());
  const Scene& scene = *loaded;
  MW_ASSIGN_OR_RETURN(const Reconstruction stored, Find(id));
  for (size_t i = 0; i < scene.views.size(); ++i) {
    v1::Camera& camera = *response.add_cameras();
    camera.set_index(static_cast<int32_t>(i));
    camera.set_name(scene.views[i].name);
    camera.set_state(v1::CAMERA_STATE_WAITING);
  }
  MW_ASSIGN_OR_RETURN(const std::vector<CameraJob> jobs, environment_.store->ListCameraJobs(id));
  MW_ASSIGN_OR_RETURN(const std::vector<Commit> commits, environment_.store->ListCommits(id));
  for (const CameraJob& job : jobs) {
    if (job.camera < 0 || job.camera >= response.cameras_size()) continue;
    v1::Camera& camera = *response.mutable_cameras(job.camera);
    const bool committed = static_cast<size_t>(job.sequence) <= commits.size();
    camera.set_state(CameraStateOf(job.state, committed, IsFinal(stored.state)));
    camera.set_sequence(job.sequence);
    camera.set_skip_reason(WithoutServerPaths(job.skip_reason));
    camera.set_report_json(job.report_json);
    camera.set_failed_attempts(static_cast<int32_t>(job.failed_attempts));
    camera.set_last_failure(WithoutServerPaths(job.last_failure));
    camera.set_reduction(static_cast<int32_t>(job.reduction));
    camera.set_worker(job.lease_worker);
    camera.set_memory_bytes(job.memory_bytes);
    if (!committed) continue;
    const Commit& commit = commits[static_cast<size_t>(job.sequence) - 1];
    camera.set_filtered_patches(commit.filtered_patches);
    camera.set_accepted_patches(commit.accepted_patches);
  }
  return response;
}

absl::StatusOr<v1::GetIncidenceResponse> ReconstructionService::GetIncidence(const std::string& id) const {
  MW_RETURN_IF_ERROR(Find(id).status());
  MW_ASSIGN_OR_RETURN(const std::vector<CameraJob> jobs, environment_.store->ListCameraJobs(id));
  v1::GetIncidenceResponse response;
  for (const CameraJob& job : jobs) {
    for (const CameraIndex target : job.neighbours) {
      v1::IncidencePair& pair = *response.add_pairs();
      pair.set_reference(job.camera);
      pair.set_target(target);
    }
  }
  return response;
}

absl::StatusOr<v1::ListAttemptsResponse> ReconstructionService::ListAttempts(
    const v1::ListAttemptsRequest& request) const {
  if (request.max_attempts() < 0 || request.max_attempts() > kMaxAttempts) {
    return absl::InvalidArgumentError(
        absl::StrCat("max_attempts is ", request.max_attempts(), ", expected 0..", kMaxAttempts));
  }
  const int limit = request.max_attempts() > 0 ? request.max_attempts() : kDefaultAttempts;
  MW_RETURN_IF_ERROR(Find(request.id()).status());
  MW_ASSIGN_OR_RETURN(const std::vector<Attempt> attempts, environment_.store->ListAttempts(request.id(), limit));
  // What runs is known as of the last turn; it may have ended since.
  std::set<std::pair<SequenceNumber, int64_t>> ended;
  for (const Attempt& attempt : attempts) ended.insert({attempt.sequence, attempt.epoch});
  v1::ListAttemptsResponse response;
  for (v1::Attempt& attempt : workers_.RunningIn(request.id())) {
    if (response.attempts_size() == limit) break;
    if (ended.count({attempt.sequence(), attempt.epoch()}) == 0) *response.add_attempts() = std::move(attempt);
  }
  for (const Attempt& attempt : attempts) {
    if (response.attempts_size() == limit) break;
    *response.add_attempts() = ToProto(request.id(), attempt);
  }
  return response;
}

absl::StatusOr<Eigen::Vector3d> ReconstructionService::OffsetOf(const std::string& id) const {
  {
    const MutexLock lock(mutex_);
    if (const auto known = offsets_.find(id); known != offsets_.end()) return known->second;
  }
  const absl::StatusOr<Scene> scene = LoadScene(id);
  if (absl::IsFailedPrecondition(scene.status())) return Eigen::Vector3d(Eigen::Vector3d::Zero());  // none taken yet
  MW_RETURN_IF_ERROR(scene.status());
  const MutexLock lock(mutex_);
  return offsets_[id] = scene->offset;
}

absl::StatusOr<v1::ListPartsResponse> ReconstructionService::ListParts(const std::string& id,
                                                                       SequenceNumber after) const {
  MW_RETURN_IF_ERROR(Find(id).status());
  MW_ASSIGN_OR_RETURN(const std::vector<Commit> commits, environment_.store->ListCommits(id, after));
  v1::ListPartsResponse response;
  for (const Commit& commit : commits) {
    if (!commit.accepted_digest.empty()) FillPart(commit, *response.add_parts());
  }
  if (response.parts().empty()) return response;
  MW_ASSIGN_OR_RETURN(const Eigen::Vector3d offset, OffsetOf(id));
  if (!offset.isZero(0)) response.mutable_offset()->Assign(offset.begin(), offset.end());
  return response;
}

absl::StatusOr<v1::Part> ReconstructionService::GetPart(const std::string& id, SequenceNumber sequence) const {
  MW_RETURN_IF_ERROR(Find(id).status());
  v1::Part part;
  if (sequence > 0) {
    MW_ASSIGN_OR_RETURN(const std::vector<Commit> commits, environment_.store->ListCommits(id, sequence - 1, 1));
    if (!commits.empty() && commits[0].sequence == sequence && !commits[0].accepted_digest.empty()) {
      FillPart(commits[0], part);
      return part;
    }
  }
  return absl::NotFoundError(absl::StrCat("sequence is ", sequence, ", which is no part of reconstruction ", id));
}

absl::StatusOr<std::string> ReconstructionService::MeshPath(const std::string& id) const {
  MW_ASSIGN_OR_RETURN(const Reconstruction stored, Find(id));
  if (stored.state != ReconstructionState::kDone) return WrongState(stored, "one that is done");
  const std::string path = folders_.MeshFile(stored.mesh.digest);
  std::error_code error;
  if (!fs::exists(path, error)) MW_RETURN_IF_ERROR(environment_.blobs->GetFile(stored.mesh.digest, path));
  return path;
}

absl::StatusOr<std::string> ReconstructionService::PartBytes(const std::string& id, SequenceNumber sequence) const {
  MW_ASSIGN_OR_RETURN(const v1::Part part, GetPart(id, sequence));
  return environment_.blobs->Get(part.sha256());
}

absl::Status ReconstructionService::Watch(const std::string& id, const std::function<bool()>& cancelled,
                                          const std::function<bool(const v1::Reconstruction&)>& send) {
  std::string told;
  while (true) {
    int64_t version = 0;
    {
      const MutexLock lock(mutex_);
      if (stopping_) return absl::UnavailableError("the coordinator is going down");
      version = version_;
    }
    if (cancelled()) return absl::CancelledError("nobody watches any more");
    MW_ASSIGN_OR_RETURN(const v1::Reconstruction reconstruction, Get(id));
    if (std::string now = reconstruction.SerializeAsString(); now != told) {
      if (!send(reconstruction)) return absl::CancelledError("nobody watches any more");
      if (IsOver(reconstruction.state())) return absl::OkStatus();
      told = std::move(now);
    }
    MutexLock lock(mutex_);
    // Other coordinators change things too.
    if (!stopping_ && version_ == version) changed_.WaitFor(lock, kLookAgain);
  }
}

void ReconstructionService::Shutdown() {
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
  }
  changed_.NotifyAll();
  overseer_wake_.NotifyAll();
}

}  // namespace meshwright
