// SPDX-License-Identifier: Apache-2.0
#include "coordinator/nodeodm/task_board.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <system_error>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_split.h>

#include "common/base/check.h"
#include "common/base/files.h"
#include "common/base/status_macros.h"
#include "common/base/version.h"
#include "common/image/decode.h"
#include "common/json/json_text.h"
#include "coordinator/api/guarded_calls.h"
#include "coordinator/nodeodm/odm_files.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

constexpr char kTaskEnding[] = ".json";
constexpr char kOutputEnding[] = ".log";
constexpr std::chrono::milliseconds kLookAgain(500);
// Uploads that were never committed; NodeODM's own default.
constexpr int64_t kUploadLifeMs = int64_t{48} * 3600 * 1000;
// Progress, percent, when the last camera is through, when surfaces are joined, and while the result is packed.
constexpr double kAtLastCamera = 90;
constexpr double kAtJoining = 92;
constexpr double kAtPacking = 95;
constexpr double kMinProgressStep = 0.1;

constexpr char kCamerasNeeded[] =
    "Photographs alone need a worker with COLMAP, and none is connected. Start one, or send the model of the cameras "
    "among "
    "the images, e.g. COLMAP's cameras.txt, images.txt and points3D.txt (or .bin), Middlebury's _par.txt or Strecha's "
    ".camera files; photographs are matched by their names";

}  // namespace

absl::StatusOr<std::unique_ptr<TaskBoard>> TaskBoard::Open(const std::string& folder, const Services& services) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) {
    return absl::PermissionDeniedError(absl::StrCat(folder, ": cannot make the folder: ", error.message()));
  }
  auto board = std::unique_ptr<TaskBoard>(new TaskBoard(folder, services));
  MW_RETURN_IF_ERROR(board->Load());
  board->follower_ = std::thread([&board = *board] { board.Follow(); });
  board->packer_ = std::thread([&board = *board] { board.Pack(); });
  return board;
}

TaskBoard::~TaskBoard() {
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
  }
  wake_.NotifyAll();
  if (follower_.joinable()) follower_.join();
  if (packer_.joinable()) packer_.join();
}

std::string TaskBoard::PathOf(const std::string& uuid, const char* ending) const {
  return absl::StrCat(folder_, "/", uuid, ending);
}

std::string TaskBoard::ResultFolder(const std::string& uuid) const { return absl::StrCat(folder_, "/", uuid); }

int64_t TaskBoard::now_ms() const { return absl::ToUnixMillis(services_.clock->Now()); }

absl::Status TaskBoard::Load() {
  const MutexLock lock(mutex_);
  std::error_code error;
  for (const fs::directory_entry& file : fs::directory_iterator(folder_, error)) {
    if (file.path().extension() != kTaskEnding) continue;
    MW_ASSIGN_OR_RETURN(const std::string text, ReadFile(file.path().string()));
    absl::StatusOr<OdmTask> task = DecodeTask(text);
    if (!task.ok()) {
      services_.warn(absl::StrCat(file.path().string(), ": ", std::string(task.status().message())));
      continue;
    }
    Entry entry = {.task = *std::move(task)};
    if (const auto output = ReadFile(PathOf(entry.task.uuid, kOutputEnding)); output.ok()) {
      entry.output = absl::StrSplit(*output, '\n');
      entry.output.pop_back();  // behind the last line break, or what a power cut left of a line
    }
    tasks_.emplace(entry.task.uuid, std::move(entry));
  }
  return absl::OkStatus();
}

absl::Status TaskBoard::Update(const std::string& uuid, const Change& change) {
  const MutexLock disk_lock(disk_mutex_);
  std::vector<std::string> lines;
  OdmTask now;
  {
    const MutexLock lock(mutex_);
    const auto found = tasks_.find(uuid);
    if (found == tasks_.end()) return NoSuchTask();
    change(found->second.task, lines);
    now = found->second.task;
    found->second.output.insert(found->second.output.end(), lines.begin(), lines.end());
  }
  if (!lines.empty()) {
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(PathOf(uuid, kOutputEnding).c_str(), "ab"),
                                                               std::fclose);
    if (file != nullptr) std::fputs((absl::StrJoin(lines, "\n") + "\n").c_str(), file.get());
  }
  return WriteFileAtomically(PathOf(uuid, kTaskEnding), EncodeTask(now));
}

absl::StatusOr<OdmTask> TaskBoard::Find(const std::string& uuid) const {
  const MutexLock lock(mutex_);
  const auto found = tasks_.find(uuid);
  if (found == tasks_.end()) return NoSuchTask();
  return found->second.task;
}

absl::StatusOr<std::string> TaskBoard::OwnerOf(const std::string& uuid) const {
  MW_ASSIGN_OR_RETURN(const OdmTask task, Find(uuid));
  return task.owner;
}

absl::StatusOr<std::string> TaskBoard::Begin(const Caller& caller, const NewOdmTask& wanted) {
  if (!wanted.uuid.empty() && !IsUuid(wanted.uuid)) {
    return absl::InvalidArgumentError(absl::StrCat("Invalid set-uuid: ", wanted.uuid.substr(0, 64)));
  }
  MW_ASSIGN_OR_RETURN(const OdmTaskOptions options, services_.options->Parse(wanted.options));
  OdmTask task = {.uuid = wanted.uuid.empty() ? DrawUuid() : wanted.uuid,
                  .name = wanted.name,
                  .owner = caller.user,
                  .options = options.given,
                  .outputs = wanted.outputs,
                  .webhook = wanted.webhook,
                  .created_ms = wanted.created_ms > 0 ? wanted.created_ms : now_ms()};
  if (task.name.empty())
    task.name = absl::StrCat("Task of ", absl::FormatTime(services_.clock->Now(), absl::UTCTimeZone()));
  if (Find(task.uuid).ok())
    return absl::InvalidArgumentError(absl::StrCat("Invalid set-uuid: ", task.uuid, " is in use"));
  v1::CreateReconstructionRequest request;
  request.set_id(task.uuid);
  request.set_options_json(OwnOptionsJson(options, /*longest_side_px=*/0));
  const auto created = CreateFor(caller, *services_.gate, *services_.reconstructions, request);
  if (absl::IsAlreadyExists(created.status())) {
    return absl::InvalidArgumentError(absl::StrCat("Invalid set-uuid: ", task.uuid, " is in use"));
  }
  MW_RETURN_IF_ERROR(created.status());
  {
    const MutexLock lock(mutex_);
    if (!tasks_.emplace(task.uuid, Entry{.task = task, .knows_files = true}).second) {
      return absl::InvalidArgumentError(absl::StrCat("Invalid set-uuid: ", task.uuid, " is in use"));
    }
  }
  MW_RETURN_IF_ERROR(Update(task.uuid, [&](OdmTask&, std::vector<std::string>& lines) {
    lines.push_back(absl::StrCat("Meshwright ", kProgramVersion));
    if (!options.unused.empty()) {
      lines.push_back(absl::StrCat("Options that have no meaning here: ", absl::StrJoin(options.unused, ", ")));
    }
  }));
  return task.uuid;
}

absl::Status TaskBoard::CheckTakesFiles(const std::string& uuid) const {
  const MutexLock lock(mutex_);
  const auto found = tasks_.find(uuid);
  return found != tasks_.end() && !found->second.task.is_committed ? absl::OkStatus() : NoSuchTask();
}

absl::Status TaskBoard::LearnFiles(const std::string& uuid) {
  MW_ASSIGN_OR_RETURN(const OdmTask task, Find(uuid));
  MW_ASSIGN_OR_RETURN(const std::vector<SceneFile> files,
                      services_.reconstructions->ListSceneFiles(ReconstructionOf(task)));
  const MutexLock lock(mutex_);
  const auto found = tasks_.find(uuid);
  if (found == tasks_.end()) return NoSuchTask();
  for (const SceneFile& file : files) found->second.files.emplace(file.path, file.digest);
  found->second.knows_files = true;
  return absl::OkStatus();
}

absl::Status TaskBoard::TakeFile(const std::string& uuid, const std::string& file_name, StagedBlob& file) {
  MW_RETURN_IF_ERROR(CheckTakesFiles(uuid));
  MW_ASSIGN_OR_RETURN(std::string name, BaseName(file_name));
  const OdmFileKind kind = KindOfFile(name);
  const std::string digest = file.HexDigest();
  int longest_side = 0;
  if (kind == OdmFileKind::kPhotograph) {
    // What is no picture is refused with all others, once they are there.
    if (const auto size = ReadImageSize(file.path()); size.ok()) longest_side = std::max(size->width, size->height);
  }
  bool knows_files = false;
  {
    const MutexLock lock(mutex_);
    const auto found = tasks_.find(uuid);
    if (found == tasks_.end()) return NoSuchTask();
    knows_files = found->second.knows_files;
    if (kind == OdmFileKind::kUnused && !found->second.unused_files.insert(name).second) return absl::OkStatus();
  }
  if (kind == OdmFileKind::kUnused) {
    return Update(uuid, [&](OdmTask&, std::vector<std::string>& lines) {
      lines.push_back(absl::StrCat(name, " is not used here"));
    });
  }
  if (!knows_files) MW_RETURN_IF_ERROR(LearnFiles(uuid));
  {
    const MutexLock lock(mutex_);
    const auto found = tasks_.find(uuid);
    if (found == tasks_.end()) return NoSuchTask();
    std::map<std::string, std::string>& files = found->second.files;
    for (auto same = files.find(name); same != files.end() && same->second != digest; same = files.find(name)) {
      name = OtherName(name);
    }
    if (services_.max_images > 0 && static_cast<int>(files.size()) >= services_.max_images && files.count(name) == 0) {
      return absl::InvalidArgumentError(
          absl::StrCat("there are more than ", services_.max_images, " images, the most that this node takes"));
    }
    files[name] = digest;
    found->second.task.longest_side_px = std::max(found->second.task.longest_side_px, longest_side);
  }
  absl::Status taken = file.Sync();
  if (taken.ok()) {
    // Repeated where it is there already: harmless, and it may just be on its way.
    const SceneFile scene_file = {.path = name, .size_bytes = file.size_bytes(), .digest = digest};
    taken = services_.reconstructions->AdoptSceneFile(uuid, scene_file, file.path());
  }
  if (!taken.ok()) {
    const MutexLock lock(mutex_);
    const auto found = tasks_.find(uuid);
    if (found != tasks_.end()) found->second.files.erase(name);
  }
  return taken;
}

absl::Status TaskBoard::Commit(const std::string& uuid) {
  MW_ASSIGN_OR_RETURN(const OdmTask task, Find(uuid));
  if (task.is_committed) return absl::OkStatus();
  MW_ASSIGN_OR_RETURN(const std::vector<SceneFile> files, services_.reconstructions->ListSceneFiles(uuid));
  const auto images = std::count_if(files.begin(), files.end(), [](const SceneFile& file) {
    return KindOfFile(file.path) == OdmFileKind::kPhotograph;
  });
  MW_RETURN_IF_ERROR(Update(uuid, [&](OdmTask& now, std::vector<std::string>&) {
    now.is_committed = true;
    now.images = static_cast<int>(images);
  }));
  {
    const MutexLock lock(mutex_);
    has_news_ = true;
  }
  wake_.NotifyAll();
  return absl::OkStatus();
}

std::vector<std::string> TaskBoard::List(const Caller& caller) const {
  std::vector<std::pair<int64_t, std::string>> all;
  {
    const MutexLock lock(mutex_);
    for (const auto& [uuid, entry] : tasks_) {
      if (!entry.task.is_committed || !MaySee(caller, uuid, entry.task.owner)) continue;
      all.emplace_back(entry.task.created_ms, uuid);
    }
  }
  std::sort(all.begin(), all.end());
  std::vector<std::string> uuids;
  for (auto& [created_ms, uuid] : all) uuids.push_back(std::move(uuid));
  return uuids;
}

absl::StatusOr<OdmTask> TaskBoard::Get(const std::string& uuid) const {
  MW_ASSIGN_OR_RETURN(OdmTask task, Find(uuid));
  if (!task.is_committed) return NoSuchTask();
  return task;
}

absl::StatusOr<std::vector<std::string>> TaskBoard::Output(const std::string& uuid, size_t line) const {
  const MutexLock lock(mutex_);
  const auto found = tasks_.find(uuid);
  if (found == tasks_.end() || !found->second.task.is_committed) return NoSuchTask();
  const std::vector<std::string>& output = found->second.output;
  return std::vector<std::string>(output.begin() + static_cast<ptrdiff_t>(std::min(line, output.size())), output.end());
}

absl::StatusOr<std::vector<std::string>> TaskBoard::Images(const std::string& uuid) const {
  MW_ASSIGN_OR_RETURN(const OdmTask task, Get(uuid));
  MW_ASSIGN_OR_RETURN(const std::vector<SceneFile> files,
                      services_.reconstructions->ListSceneFiles(ReconstructionOf(task)));
  std::vector<std::string> names;
  for (const SceneFile& file : files) {
    if (KindOfFile(file.path) == OdmFileKind::kPhotograph) names.push_back(file.path);
  }
  return names;
}

int TaskBoard::queued_or_running() const {
  const MutexLock lock(mutex_);
  return static_cast<int>(std::count_if(tasks_.begin(), tasks_.end(), [](const auto& item) {
    return item.second.task.is_committed && !HasEnded(item.second.task);
  }));
}

absl::Status TaskBoard::Cancel(const std::string& uuid) {
  MW_ASSIGN_OR_RETURN(const OdmTask task, Get(uuid));
  if (HasEnded(task)) return absl::OkStatus();
  const absl::Status cancelled = services_.reconstructions->Cancel(ReconstructionOf(task)).status();
  if (!absl::IsNotFound(cancelled)) MW_RETURN_IF_ERROR(cancelled);
  End(task, OdmStatus::kCancelled, "");
  return absl::OkStatus();
}

absl::Status TaskBoard::Remove(const std::string& uuid) {
  MW_ASSIGN_OR_RETURN(OdmTask task, Find(uuid));
  // A run before that could not be deleted at its time goes too.
  for (; task.run >= 0; --task.run) {
    const absl::Status deleted = services_.reconstructions->Delete(ReconstructionOf(task));
    if (!absl::IsNotFound(deleted)) MW_RETURN_IF_ERROR(deleted);
  }
  const MutexLock disk_lock(disk_mutex_);
  {
    const MutexLock lock(mutex_);
    tasks_.erase(uuid);
  }
  std::error_code error;
  fs::remove(PathOf(uuid, kTaskEnding), error);
  fs::remove(PathOf(uuid, kOutputEnding), error);
  fs::remove_all(ResultFolder(uuid), error);
  return absl::OkStatus();
}

absl::Status TaskBoard::Again(const OdmTask& from, OdmTask& to, const OdmTaskOptions& options) {
  to.run = from.run + 1;
  v1::CreateReconstructionRequest request;
  request.set_id(ReconstructionOf(to));
  request.set_options_json(OwnOptionsJson(options, from.longest_side_px));
  return services_.reconstructions->CreateAgain(ReconstructionOf(from), request, from.owner).status();
}

absl::Status TaskBoard::Restart(const std::string& uuid, const std::optional<std::string>& given) {
  MW_ASSIGN_OR_RETURN(const OdmTask task, Get(uuid));
  if (!HasEnded(task)) return absl::FailedPreconditionError("Task cannot be restarted: it is queued or running");
  MW_ASSIGN_OR_RETURN(const OdmTaskOptions options, services_.options->Parse(given.value_or(JsonText(task.options))));
  OdmTask next = task;
  MW_RETURN_IF_ERROR(Again(task, next, options));
  std::error_code error;
  {
    const MutexLock disk_lock(disk_mutex_);
    const MutexLock lock(mutex_);
    const auto found = tasks_.find(uuid);
    if (found == tasks_.end()) return NoSuchTask();
    found->second.output.clear();
    fs::remove(PathOf(uuid, kOutputEnding), error);
    fs::remove_all(ResultFolder(uuid), error);
  }
  MW_RETURN_IF_ERROR(Update(uuid, [&](OdmTask& now, std::vector<std::string>& lines) {
    now.run = next.run;
    now.options = options.given;
    now.created_ms = now_ms();
    now.begun_ms = now.ended_ms = 0;
    now.status = OdmStatus::kQueued;
    now.error.clear();
    now.progress = 0;
    now.parts_told = 0;
    now.stage_told.clear();
    now.has_result = false;
    lines.push_back(absl::StrCat("Meshwright ", kProgramVersion, ", started again"));
  }));
  services_.reconstructions->Delete(ReconstructionOf(task)).IgnoreError();
  {
    const MutexLock lock(mutex_);
    has_news_ = true;
  }
  wake_.NotifyAll();
  return absl::OkStatus();
}

absl::StatusOr<std::shared_ptr<const ZipArchive>> TaskBoard::Archive(const std::string& uuid) const {
  MW_ASSIGN_OR_RETURN(const OdmTask task, Get(uuid));
  if (!task.has_result) return absl::FailedPreconditionError("Asset not ready");
  MW_ASSIGN_OR_RETURN(const std::vector<ZipEntry> entries, ResultPackage::Entries(ResultFolder(uuid), task.outputs));
  return ZipArchive::Open(entries);
}

void TaskBoard::Follow() {
  while (true) {
    FollowOnce();
    MutexLock lock(mutex_);
    if (!stopping_ && !has_news_) wake_.WaitFor(lock, kLookAgain);
    has_news_ = false;
    if (stopping_) return;
  }
}

void TaskBoard::FollowOnce() {
  std::vector<OdmTask> open;
  std::vector<std::string> abandoned;
  {
    const MutexLock lock(mutex_);
    for (const auto& [uuid, entry] : tasks_) {
      if (entry.task.is_committed && !HasEnded(entry.task)) open.push_back(entry.task);
      if (!entry.task.is_committed && now_ms() - entry.task.created_ms > kUploadLifeMs) abandoned.push_back(uuid);
    }
  }
  for (const OdmTask& task : open) Look(task);
  for (const std::string& uuid : abandoned) Remove(uuid).IgnoreError();
}

void TaskBoard::Look(const OdmTask& task) {
  const absl::StatusOr<v1::Reconstruction> reconstruction = services_.reconstructions->Get(ReconstructionOf(task));
  if (absl::IsNotFound(reconstruction.status())) {
    return End(task, OdmStatus::kFailed, "the reconstruction was removed by other means");
  }
  if (!reconstruction.ok()) return;  // the store is away for a while
  switch (reconstruction->state()) {
    case v1::RECONSTRUCTION_STATE_CREATED: {
      const absl::Status started = StartRun(task);
      if (absl::IsInvalidArgument(started) || absl::IsFailedPrecondition(started)) {
        services_.reconstructions->Cancel(ReconstructionOf(task)).IgnoreError();
        End(task, OdmStatus::kFailed, std::string(started.message()));
      }
      return;
    }
    case v1::RECONSTRUCTION_STATE_PREPARING:
      return TellStage(task, reconstruction->stage());
    case v1::RECONSTRUCTION_STATE_RUNNING:
    case v1::RECONSTRUCTION_STATE_JOINING:
      return Progress(task, *reconstruction);
    case v1::RECONSTRUCTION_STATE_DONE: {
      Progress(task, *reconstruction);
      const MutexLock lock(mutex_);
      if (std::find(to_pack_.begin(), to_pack_.end(), task.uuid) == to_pack_.end()) to_pack_.push_back(task.uuid);
      wake_.NotifyAll();
      return;
    }
    case v1::RECONSTRUCTION_STATE_FAILED:
      return End(task, OdmStatus::kFailed, reconstruction->failure());
    case v1::RECONSTRUCTION_STATE_CANCELLED:
      return End(task, OdmStatus::kCancelled, "");
    default:
      return;
  }
}

absl::Status TaskBoard::StartRun(const OdmTask& task) {
  MW_ASSIGN_OR_RETURN(const std::vector<SceneFile> files,
                      services_.reconstructions->ListSceneFiles(ReconstructionOf(task)));
  const bool has_cameras = std::any_of(
      files.begin(), files.end(), [](const SceneFile& file) { return KindOfFile(file.path) == OdmFileKind::kCameras; });
  if (!has_cameras && !services_.can_estimate_cameras()) return absl::FailedPreconditionError(kCamerasNeeded);
  MW_ASSIGN_OR_RETURN(const OdmTaskOptions options, services_.options->Parse(JsonText(task.options)));
  OdmTask run = task;
  // How large the photographs are was not known when the task began.
  if (run.run == 0 && options.image_scale < 1) {
    MW_RETURN_IF_ERROR(Again(task, run, options));
    MW_RETURN_IF_ERROR(Update(task.uuid, [&](OdmTask& now, std::vector<std::string>&) { now.run = run.run; }));
    services_.reconstructions->Delete(ReconstructionOf(task)).IgnoreError();
  }
  MW_RETURN_IF_ERROR(services_.reconstructions->Start(ReconstructionOf(run)).status());
  return Update(task.uuid, [&](OdmTask&, std::vector<std::string>& lines) {
    lines.push_back(absl::StrCat(task.images, " photographs of up to ", task.longest_side_px, " px; options ",
                                 OwnOptionsJson(options, task.longest_side_px)));
  });
}

void TaskBoard::TellStage(const OdmTask& task, const std::string& stage) {
  // "cameras: matching photographs, 43 %": told once each, less the number that moves.
  const std::string words = stage.substr(0, stage.find_last_of(','));
  if (words.empty()) return;
  Update(task.uuid, [&](OdmTask& now, std::vector<std::string>& lines) {
    if (now.run != task.run || HasEnded(now) || now.stage_told == words) return;
    if (now.begun_ms == 0) now.begun_ms = now_ms();
    now.status = OdmStatus::kRunning;
    now.stage_told = words;
    lines.push_back(words);
  }).IgnoreError();
}

void TaskBoard::Progress(const OdmTask& task, const v1::Reconstruction& reconstruction) {
  const auto parts =
      services_.reconstructions->ListParts(reconstruction.id(), static_cast<SequenceNumber>(task.parts_told));
  const v1::Progress& progress = reconstruction.progress();
  double percent =
      progress.cameras_total() > 0 ? kAtLastCamera * progress.cameras_committed() / progress.cameras_total() : 0;
  if (reconstruction.state() == v1::RECONSTRUCTION_STATE_JOINING) percent = kAtJoining;
  if (reconstruction.state() == v1::RECONSTRUCTION_STATE_DONE) percent = kAtPacking;
  percent = std::max(percent, task.progress);
  std::vector<std::string> told;
  int64_t parts_told = task.parts_told;
  if (parts.ok()) {
    for (const v1::Part& part : parts->parts()) {
      parts_told = part.sequence();
      told.push_back(absl::StrCat("Camera ", part.camera(), ": ", part.patches(), " patches of surface"));
    }
  }
  if (task.status == OdmStatus::kRunning && told.empty() && percent - task.progress < kMinProgressStep) return;
  if (!told.empty() && percent < kAtJoining) {
    told.push_back(
        absl::StrCat(progress.cameras_committed(), " of ", progress.cameras_total(), " cameras are through"));
  }
  if (percent >= kAtJoining && task.progress < kAtJoining) told.emplace_back("Joining the surfaces");
  Update(task.uuid, [&](OdmTask& now, std::vector<std::string>& lines) {
    if (now.run != task.run || HasEnded(now)) return;
    if (now.begun_ms == 0) now.begun_ms = now_ms();
    now.status = OdmStatus::kRunning;
    now.progress = percent;
    now.parts_told = parts_told;
    lines = told;
  }).IgnoreError();
}

void TaskBoard::End(const OdmTask& task, OdmStatus status, const std::string& error) {
  const absl::Status ended = Update(task.uuid, [&](OdmTask& now, std::vector<std::string>& lines) {
    if (now.run != task.run || HasEnded(now)) return;
    now.status = status;
    now.error = error;
    now.ended_ms = now_ms();
    now.has_result = status == OdmStatus::kCompleted;
    if (now.has_result) now.progress = 100;
    if (status == OdmStatus::kCompleted) lines.emplace_back("Done");
    if (status == OdmStatus::kCancelled) lines.emplace_back("Cancelled");
    if (status == OdmStatus::kFailed) lines.push_back(absl::StrCat("Failed: ", error));
  });
  if (!ended.ok() && !absl::IsNotFound(ended)) services_.warn(std::string(ended.message()));
}

void TaskBoard::Pack() {
  while (true) {
    std::string uuid;
    {
      MutexLock lock(mutex_);
      while (!stopping_ && to_pack_.empty()) wake_.Wait(lock);
      if (stopping_) return;
      uuid = to_pack_.front();
    }
    if (const auto task = Get(uuid); task.ok() && !HasEnded(*task)) PackOne(*task);
    const MutexLock lock(mutex_);
    to_pack_.pop_front();
  }
}

void TaskBoard::PackOne(const OdmTask& task) {
  const auto options = services_.options->Parse(JsonText(task.options));
  const bool skips_model = options.ok() && options->skips_model;
  Update(task.uuid, [&](OdmTask&, std::vector<std::string>& lines) {
    lines.emplace_back(skips_model ? "Packing the result" : "Cutting the texture and packing the result");
  }).IgnoreError();
  const auto output = Output(task.uuid, 0);
  const ResultPackage::Sources sources = {.reconstructions = services_.reconstructions,
                                          .blobs = services_.blobs,
                                          .write_textured_glb = services_.write_textured_glb};
  const absl::Status made = ResultPackage::Make(task, skips_model, output.ok() ? *output : std::vector<std::string>(),
                                                sources, ResultFolder(task.uuid));
  End(task, made.ok() ? OdmStatus::kCompleted : OdmStatus::kFailed, made.ok() ? "" : std::string(made.message()));
  // It may have been removed, cancelled or started again meanwhile.
  const auto now = Get(task.uuid);
  if (now.ok() && now->has_result) return;
  std::error_code error;
  fs::remove_all(ResultFolder(task.uuid), error);
}

}  // namespace meshwright
