#include "coordinator/api/reconstruction_logic.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <utility>

#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"
#include "common/scene/scene_codec.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

constexpr int kDefaultPageSize = 100;
constexpr int kMaxPageSize = 1000;
constexpr double kMaxWeight = 1000;
constexpr std::chrono::milliseconds kLookAgain(500);

void FillTime(absl::Time time, google::protobuf::Timestamp& timestamp) {
  const int64_t microseconds = absl::ToUnixMicros(time);
  timestamp.set_seconds(microseconds / 1'000'000);
  timestamp.set_nanos(static_cast<int32_t>(microseconds % 1'000'000) * 1000);
}

bool IsConducted(v1::ReconstructionState state) {
  return state == v1::RECONSTRUCTION_STATE_PREPARING || state == v1::RECONSTRUCTION_STATE_RUNNING ||
         state == v1::RECONSTRUCTION_STATE_JOINING;
}

absl::Status WrongState(const ReconstructionRecord& record, const char* expected) {
  return absl::FailedPreconditionError(absl::StrCat(
      "reconstruction ", record.id, " is ", v1::ReconstructionState_Name(record.state), ", expected ", expected));
}

v1::CameraState ToProto(CameraJobState state, bool committed) {
  if (state == CameraJobState::kSetAside) return v1::CAMERA_STATE_SET_ASIDE;
  if (committed) return v1::CAMERA_STATE_COMMITTED;
  return state == CameraJobState::kDone ? v1::CAMERA_STATE_DONE : v1::CAMERA_STATE_ASSIGNED;
}

}  // namespace

bool IsOver(v1::ReconstructionState state) {
  return state == v1::RECONSTRUCTION_STATE_DONE || state == v1::RECONSTRUCTION_STATE_FAILED ||
         state == v1::RECONSTRUCTION_STATE_CANCELLED;
}

ReconstructionLogic::ReconstructionLogic(const ReconstructionLogicOptions& options,
                                         const ConductingEnvironment& environment, RecordFolder records)
    : options_(options), environment_(environment), records_(std::move(records)) {}

absl::StatusOr<std::unique_ptr<ReconstructionLogic>> ReconstructionLogic::Open(
    const ReconstructionLogicOptions& options, const ConductingEnvironment& environment) {
  MW_ASSIGN_OR_RETURN(RecordFolder records, RecordFolder::Open(absl::StrCat(options.data_folder, "/reconstructions")));
  for (const char* folder : {"uploads", "meshes"}) {
    std::error_code error;
    fs::create_directories(fs::path(options.data_folder) / folder, error);
    if (error) {
      return absl::PermissionDeniedError(
          absl::StrCat(options.data_folder, "/", folder, ": cannot make the folder: ", error.message()));
    }
  }
  MW_ASSIGN_OR_RETURN(std::vector<ReconstructionRecord> loaded, records.LoadAll());
  auto logic = std::unique_ptr<ReconstructionLogic>(new ReconstructionLogic(options, environment, std::move(records)));
  const std::lock_guard<std::mutex> lock(logic->mutex_);
  for (ReconstructionRecord& record : loaded) {
    Entry& entry = logic->entries_[record.id];
    entry.record = std::move(record);
    if (!entry.record.deleted && IsConducted(entry.record.state)) logic->Conduct(entry);
  }
  return logic;
}

ReconstructionLogic::~ReconstructionLogic() {
  Shutdown();
  std::vector<std::unique_ptr<ConductedReconstruction>> conducted;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (auto& [id, entry] : entries_) {
      if (entry.conducted == nullptr) continue;
      entry.conducted->RequestStop();
      conducted.push_back(std::move(entry.conducted));
    }
  }
}

std::string ReconstructionLogic::UploadFolder(const std::string& id) const {
  return absl::StrCat(options_.data_folder, "/uploads/", id);
}

std::string ReconstructionLogic::MeshFile(const std::string& id) const {
  return absl::StrCat(options_.data_folder, "/meshes/", id, ".ply");
}

absl::StatusOr<ReconstructionLogic::Entry*> ReconstructionLogic::Find(const std::string& id) const {
  const auto found = entries_.find(id);
  if (found == entries_.end() || found->second.record.deleted) {
    return absl::NotFoundError(absl::StrCat("there is no reconstruction \"", id.substr(0, 64), "\""));
  }
  return &found->second;
}

v1::Reconstruction ReconstructionLogic::ToProto(const Entry& entry) const {
  const ReconstructionRecord& record = entry.record;
  v1::Reconstruction reconstruction;
  reconstruction.set_id(record.id);
  reconstruction.set_state(record.state);
  reconstruction.set_failure(record.failure);
  reconstruction.set_options_json(record.options_json);
  reconstruction.set_scene_reference(record.scene_reference);
  reconstruction.set_weight(record.weight);
  FillTime(record.created, *reconstruction.mutable_create_time());
  if (record.finished != absl::InfinitePast()) FillTime(record.finished, *reconstruction.mutable_finish_time());
  reconstruction.set_mesh_bytes(record.mesh_bytes);
  reconstruction.set_mesh_sha256(record.mesh_sha256);
  v1::Progress& progress = *reconstruction.mutable_progress();
  progress.set_vertices(record.vertices);
  progress.set_faces(record.faces);
  if (entry.conducted != nullptr) {
    const Progress conducted = entry.conducted->snapshot().progress;
    progress.set_cameras_total(conducted.cameras_total);
    progress.set_cameras_committed(conducted.cameras_committed);
    progress.set_cameras_set_aside(conducted.cameras_set_aside);
    progress.set_cameras_in_flight(conducted.cameras_in_flight);
    progress.set_patches_filtered(conducted.patches_filtered);
    progress.set_patches_accepted(conducted.patches_accepted);
    progress.set_jobs_leased(environment_.workers->LeasesIn(record.id));
  }
  return reconstruction;
}

void ReconstructionLogic::Conduct(Entry& entry) {
  const std::string id = entry.record.id;
  std::string scene_folder = UploadFolder(id);
  if (!entry.record.scene_reference.empty()) {
    // One that is gone meanwhile fails as any scene that is not there.
    scene_folder = ResolveSceneReference(entry.record.scene_reference, options_.scene_roots)
                       .value_or(entry.record.scene_reference);
  }
  entry.conducted = std::make_unique<ConductedReconstruction>(
      environment_, entry.record, scene_folder, MeshFile(id),
      [this, id](const std::function<void(ReconstructionRecord&)>& change) { return Update(id, change); },
      [this, id] { Touch(id); });
}

absl::StatusOr<bool> ReconstructionLogic::Update(const std::string& id,
                                                 const std::function<void(ReconstructionRecord&)>& change) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    Entry& entry = entries_.at(id);
    if (entry.record.deleted || IsOver(entry.record.state)) return false;
    ReconstructionRecord changed = entry.record;
    change(changed);
    MW_RETURN_IF_ERROR(records_.Save(changed));
    entry.record = std::move(changed);
    ++entry.version;
  }
  changed_.notify_all();
  return true;
}

void ReconstructionLogic::Touch(const std::string& id) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    ++entries_.at(id).version;
  }
  changed_.notify_all();
}

absl::StatusOr<v1::Reconstruction> ReconstructionLogic::Create(const v1::CreateReconstructionRequest& request) {
  MW_RETURN_IF_ERROR(ValidateReconstructionId(request.id()));
  if (!(request.weight() >= 0 && request.weight() <= kMaxWeight)) {
    return absl::InvalidArgumentError(absl::StrCat("weight is ", request.weight(), ", expected 0..", kMaxWeight));
  }
  MW_ASSIGN_OR_RETURN(const Method method, environment_.parse_method(request.options_json()));
  if (!request.scene_reference().empty()) {
    MW_RETURN_IF_ERROR(ResolveSceneReference(request.scene_reference(), options_.scene_roots).status());
  }
  const ReconstructionRecord record = {.id = request.id(),
                                       .options_json = method.options_json,
                                       .scene_reference = request.scene_reference(),
                                       .weight = request.weight() > 0 ? request.weight() : 1,
                                       .created = environment_.clock->Now()};
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto found = entries_.find(record.id);
  if (found != entries_.end()) {
    const ReconstructionRecord& before = found->second.record;
    if (!before.deleted && before.options_json == record.options_json &&
        before.scene_reference == record.scene_reference && before.weight == record.weight) {
      return ToProto(found->second);
    }
    return absl::AlreadyExistsError(
        absl::StrCat("id \"", record.id, "\" is that of ",
                     before.deleted ? "a reconstruction that was deleted" : "another reconstruction"));
  }
  MW_RETURN_IF_ERROR(records_.Save(record));
  Entry& entry = entries_[record.id];
  entry.record = record;
  return ToProto(entry);
}

absl::StatusOr<SceneFileUpload> ReconstructionLogic::BeginUpload(const v1::UploadSceneFileRequest::Header& header) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    MW_ASSIGN_OR_RETURN(const Entry* const entry, Find(header.reconstruction_id()));
    if (entry->record.state != v1::RECONSTRUCTION_STATE_CREATED) return WrongState(entry->record, "one not started");
    if (!entry->record.scene_reference.empty()) {
      return absl::FailedPreconditionError(
          absl::StrCat("reconstruction ", entry->record.id, " has a scene_reference; nothing is uploaded to it"));
    }
  }
  return SceneFileUpload::Begin(UploadFolder(header.reconstruction_id()), header.path(), header.size_bytes(),
                                header.sha256());
}

absl::StatusOr<v1::Reconstruction> ReconstructionLogic::Start(const std::string& id) {
  const std::lock_guard<std::mutex> lock(mutex_);
  MW_ASSIGN_OR_RETURN(Entry* const entry, Find(id));
  if (entry->record.state == v1::RECONSTRUCTION_STATE_CREATED) {
    ReconstructionRecord started = entry->record;
    started.state = v1::RECONSTRUCTION_STATE_PREPARING;
    MW_RETURN_IF_ERROR(records_.Save(started));
    entry->record = std::move(started);
    ++entry->version;
    Conduct(*entry);
  }
  if (entry->record.state == v1::RECONSTRUCTION_STATE_CANCELLED) return WrongState(entry->record, "one not cancelled");
  return ToProto(*entry);
}

absl::StatusOr<v1::Reconstruction> ReconstructionLogic::Get(const std::string& id) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  MW_ASSIGN_OR_RETURN(const Entry* const entry, Find(id));
  return ToProto(*entry);
}

absl::StatusOr<v1::ListReconstructionsResponse> ReconstructionLogic::List(
    const v1::ListReconstructionsRequest& request) const {
  if (request.page_size() < 0 || request.page_size() > kMaxPageSize) {
    return absl::InvalidArgumentError(
        absl::StrCat("page_size is ", request.page_size(), ", expected 0..", kMaxPageSize));
  }
  const int page_size = request.page_size() > 0 ? request.page_size() : kDefaultPageSize;
  v1::ListReconstructionsResponse response;
  const std::lock_guard<std::mutex> lock(mutex_);
  // A page's token is the last id of the page before.
  for (auto it = entries_.upper_bound(request.page_token()); it != entries_.end(); ++it) {
    if (it->second.record.deleted) continue;
    if (response.reconstructions_size() == page_size) {
      response.set_next_page_token(response.reconstructions(page_size - 1).id());
      break;
    }
    *response.add_reconstructions() = ToProto(it->second);
  }
  return response;
}

absl::Status ReconstructionLogic::StopEntry(Entry& entry, const std::function<void(ReconstructionRecord&)>& change) {
  ReconstructionRecord changed = entry.record;
  change(changed);
  MW_RETURN_IF_ERROR(records_.Save(changed));
  entry.record = std::move(changed);
  ++entry.version;
  if (entry.conducted != nullptr) {
    entry.conducted->RequestStop();
    environment_.workers->RemoveReconstruction(entry.record.id);
  }
  return absl::OkStatus();
}

absl::StatusOr<v1::Reconstruction> ReconstructionLogic::Cancel(const std::string& id) {
  const std::unique_lock<std::mutex> lock(mutex_);
  MW_ASSIGN_OR_RETURN(Entry* const entry, Find(id));
  if (!IsOver(entry->record.state)) {
    MW_RETURN_IF_ERROR(StopEntry(*entry, [&](ReconstructionRecord& record) {
      record.state = v1::RECONSTRUCTION_STATE_CANCELLED;
      record.finished = environment_.clock->Now();
    }));
  }
  changed_.notify_all();
  return ToProto(*entry);
}

absl::Status ReconstructionLogic::Delete(const std::string& id) {
  const std::unique_lock<std::mutex> lock(mutex_);
  MW_ASSIGN_OR_RETURN(Entry* const entry, Find(id));
  MW_RETURN_IF_ERROR(StopEntry(*entry, [](ReconstructionRecord& record) { record.deleted = true; }));
  std::error_code error;
  fs::remove(MeshFile(id), error);
  fs::remove_all(UploadFolder(id), error);
  changed_.notify_all();
  return absl::OkStatus();
}

absl::StatusOr<Scene> ReconstructionLogic::LoadScene(const std::string& id) const {
  std::string scene_blob;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    MW_ASSIGN_OR_RETURN(const Entry* const entry, Find(id));
    if (entry->record.scene_blob.empty()) return WrongState(entry->record, "one whose scene has been checked");
    scene_blob = entry->record.scene_blob;
  }
  MW_ASSIGN_OR_RETURN(const std::string bytes, environment_.blobs->Get(scene_blob));
  return DecodeScene(bytes);
}

absl::StatusOr<v1::ListCamerasResponse> ReconstructionLogic::ListCameras(const std::string& id) const {
  v1::ListCamerasResponse response;
  const absl::StatusOr<Scene> loaded = LoadScene(id);
  if (absl::IsFailedPrecondition(loaded.status())) return response;
  MW_RETURN_IF_ERROR(loaded.status());
  const Scene& scene = *loaded;
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
    camera.set_state(meshwright::ToProto(job.state, committed));
    camera.set_sequence(job.sequence);
    camera.set_set_aside_reason(job.set_aside_reason);
    camera.set_report_json(job.report_json);
    if (!committed) continue;
    const Commit& commit = commits[static_cast<size_t>(job.sequence) - 1];
    camera.set_filtered_patches(commit.filtered_patches);
    camera.set_accepted_patches(commit.accepted_patches);
  }
  return response;
}

absl::StatusOr<v1::GetIncidenceResponse> ReconstructionLogic::GetIncidence(const std::string& id) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  MW_ASSIGN_OR_RETURN(const Entry* const entry, Find(id));
  v1::GetIncidenceResponse response;
  if (entry->conducted == nullptr) return response;
  for (const auto& [reference, target] : entry->conducted->snapshot().pairs) {
    v1::IncidencePair& pair = *response.add_pairs();
    pair.set_reference(reference);
    pair.set_target(target);
  }
  return response;
}

absl::StatusOr<v1::ListPartsResponse> ReconstructionLogic::ListParts(const std::string& id) const {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    MW_RETURN_IF_ERROR(Find(id).status());
  }
  v1::ListPartsResponse response;
  const absl::StatusOr<std::vector<Commit>> commits = environment_.store->ListCommits(id);
  if (absl::IsNotFound(commits.status())) return response;  // not begun
  MW_RETURN_IF_ERROR(commits.status());
  for (const Commit& commit : *commits) {
    if (commit.accepted_digest.empty()) continue;
    v1::Part& part = *response.add_parts();
    part.set_sequence(commit.sequence);
    part.set_camera(commit.camera);
    part.set_sha256(commit.accepted_digest);
    part.set_patches(commit.accepted_patches);
  }
  return response;
}

absl::StatusOr<std::string> ReconstructionLogic::MeshPath(const std::string& id) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  MW_ASSIGN_OR_RETURN(const Entry* const entry, Find(id));
  if (entry->record.state != v1::RECONSTRUCTION_STATE_DONE) return WrongState(entry->record, "one that is done");
  return MeshFile(id);
}

absl::StatusOr<std::string> ReconstructionLogic::PartBytes(const std::string& id, int32_t sequence) const {
  MW_ASSIGN_OR_RETURN(const v1::ListPartsResponse parts, ListParts(id));
  for (const v1::Part& part : parts.parts()) {
    if (part.sequence() == sequence) return environment_.blobs->Get(part.sha256());
  }
  return absl::NotFoundError(absl::StrCat("reconstruction ", id, " has no part with sequence ", sequence));
}

absl::Status ReconstructionLogic::Watch(const std::string& id,
                                        const std::function<bool(const v1::Reconstruction&)>& send) {
  int64_t told = -1;
  std::unique_lock<std::mutex> lock(mutex_);
  while (true) {
    MW_ASSIGN_OR_RETURN(const Entry* const entry, Find(id));
    if (stopping_) return absl::UnavailableError("the coordinator is going down");
    if (entry->version == told) {
      changed_.wait_for(lock, kLookAgain);
      continue;
    }
    told = entry->version;
    const v1::Reconstruction reconstruction = ToProto(*entry);
    lock.unlock();
    if (!send(reconstruction)) return absl::CancelledError("nobody watches any more");
    if (IsOver(reconstruction.state())) return absl::OkStatus();
    lock.lock();
  }
}

void ReconstructionLogic::Shutdown() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
}

}  // namespace meshwright
