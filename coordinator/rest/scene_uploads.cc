// SPDX-License-Identifier: Apache-2.0
#include "coordinator/rest/scene_uploads.h"

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <optional>
#include <type_traits>
#include <utility>

#include <absl/strings/cord.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/time/time.h>
#include <nlohmann/json.hpp>

#include "common/base/digest.h"
#include "common/base/files.h"
#include "common/base/relative_path.h"
#include "common/base/status_macros.h"
#include "common/blob/blob_store.h"
#include "common/json/json_text.h"
#include "common/json/parse_json.h"
#include "coordinator/api/reconstruction_record.h"
#include "coordinator/rest/problem.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

constexpr char kOffsetPayload[] = "meshwright/upload-offset";
constexpr char kStateEnding[] = ".json";
// Files that nobody went on with for so long are given up.
constexpr absl::Duration kUnfinishedLifetime = absl::Hours(24 * 7);
// More files than these at a time are read again when their next part comes.
constexpr size_t kMaxDigests = 4096;

absl::Status Check(const SceneFilePart& part) {
  MW_RETURN_IF_ERROR(ValidateRelativePath(part.path));
  if (const absl::Status valid = ValidateDigest(part.sha256, "sha256"); !valid.ok()) return FieldError("sha256", valid);
  if (!part.part_sha256.empty()) {
    const absl::Status valid = ValidateDigest(part.part_sha256, "partSha256");
    if (!valid.ok()) return FieldError("partSha256", valid);
  }
  if (part.offset_bytes > part.size_bytes) {
    return FieldError("offset", absl::InvalidArgumentError(absl::StrCat(
                                    "offset is ", part.offset_bytes, ", expected 0..", part.size_bytes, ", the size")));
  }
  return absl::OkStatus();
}

absl::Status WrongDigest(const std::string& field, const std::string& said, const std::string& found) {
  return FieldError(
      field,
      HttpError(422, absl::InvalidArgumentError(absl::StrCat(field, " is ", said, ", that of the bytes is ", found))));
}

std::string Encode(const SceneFileState& state) {
  return JsonText(nlohmann::json({{"path", state.path},
                                  {"size_bytes", state.size_bytes},
                                  {"sha256", state.sha256},
                                  {"offset_bytes", state.offset_bytes},
                                  {"complete", state.complete},
                                  {"staged_name", state.staged_name}}));
}

template <typename Value>
bool Take(const nlohmann::json& json, const char* name, Value& value) {
  const auto found = json.find(name);
  if (found == json.end()) return false;
  if constexpr (std::is_same_v<Value, std::string>) {
    if (!found->is_string()) return false;
  } else if constexpr (std::is_same_v<Value, bool>) {
    if (!found->is_boolean()) return false;
  } else {
    if (!found->is_number_integer()) return false;
  }
  value = found->template get<Value>();
  return true;
}

std::optional<SceneFileState> Decode(const std::string& text) {
  const absl::StatusOr<nlohmann::json> json = ParseJson(text);
  if (!json.ok() || !json->is_object()) return std::nullopt;
  SceneFileState state;
  const bool known = Take(*json, "path", state.path) && Take(*json, "size_bytes", state.size_bytes) &&
                     Take(*json, "sha256", state.sha256) && Take(*json, "offset_bytes", state.offset_bytes) &&
                     Take(*json, "complete", state.complete) && Take(*json, "staged_name", state.staged_name);
  if (!known || (!state.staged_name.empty() && !ValidateRelativePath(state.staged_name).ok())) return std::nullopt;
  return state;
}

std::optional<SceneFileState> Load(const std::string& state_path) {
  const absl::StatusOr<std::string> text = ReadFile(state_path);
  if (!text.ok()) return std::nullopt;
  return Decode(*text);
}

absl::Status WithExpectedOffset(int64_t offset, absl::Status status) {
  if (!status.ok()) status.SetPayload(kOffsetPayload, absl::Cord(absl::StrCat(offset)));
  return status;
}

absl::Status WrongOffset(int64_t offset, int64_t expected) {
  return WithExpectedOffset(
      expected, FieldError("offset", absl::AbortedError(absl::StrCat("offset is ", offset, ", expected ", expected))));
}

}  // namespace

absl::StatusOr<std::unique_ptr<SceneUploads>> SceneUploads::Open(const std::string& folder,
                                                                 ReconstructionService& service) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) {
    return absl::PermissionDeniedError(absl::StrCat(folder, ": cannot make the folder: ", error.message()));
  }
  auto uploads = std::unique_ptr<SceneUploads>(new SceneUploads(folder, service));
  uploads->Sweep();
  return uploads;
}

std::string SceneUploads::StatePath(const std::string& id, const std::string& path) const {
  // Whatever the path is, its digest is a file's name.
  return absl::StrCat(folder_, "/", id, "/", Sha256Hex(path), kStateEnding);
}

absl::Status SceneUploads::CheckTakesFiles(const std::string& id) const {
  MW_ASSIGN_OR_RETURN(const v1::Reconstruction reconstruction, service_.Get(id));
  if (reconstruction.state() != v1::RECONSTRUCTION_STATE_CREATED) {
    return absl::FailedPreconditionError(
        absl::StrCat("reconstruction ", id, " is ", InWords(reconstruction.state()), ", expected one not started"));
  }
  if (!reconstruction.scene_reference().empty()) {
    return absl::FailedPreconditionError(
        absl::StrCat("reconstruction ", id, " has a sceneReference; nothing is uploaded to it"));
  }
  return absl::OkStatus();
}

absl::Status SceneUploads::Save(const std::string& id, const SceneFileState& state) const {
  return WriteFileAtomically(StatePath(id, state.path), Encode(state));
}

std::string SceneUploads::StagedPath(const SceneFileState& state) const {
  return absl::StrCat(service_.staging_folder(), "/", state.staged_name);
}

// A file for the bytes of `state`, behind those that are there.
absl::StatusOr<std::unique_ptr<StagedBlob>> SceneUploads::Stage(const std::string& state_path, SceneFileState& state) {
  if (state.offset_bytes == 0) {
    std::error_code error;
    if (!state.staged_name.empty()) fs::remove(StagedPath(state), error);
    MW_ASSIGN_OR_RETURN(const std::string path, StagedBlob::NewPath(service_.staging_folder()));
    state.staged_name = fs::path(path).filename();
    return StagedBlob::Open(path);
  }
  {
    const MutexLock lock(mutex_);
    const auto known = digests_.find(state_path);
    if (known != digests_.end()) return StagedBlob::Open(StagedPath(state), state.offset_bytes, known->second);
  }
  MW_ASSIGN_OR_RETURN(const Sha256Stream digest, StagedBlob::DigestOf(StagedPath(state), state.offset_bytes));
  Remember(state_path, digest);
  return StagedBlob::Open(StagedPath(state), state.offset_bytes, digest);
}

void SceneUploads::Remember(const std::string& state_path, const Sha256Stream& digest) {
  const MutexLock lock(mutex_);
  if (digests_.size() >= kMaxDigests) digests_.erase(digests_.begin());
  digests_.insert_or_assign(state_path, digest);
}

void SceneUploads::Forget(const std::string& state_path) {
  const MutexLock lock(mutex_);
  digests_.erase(state_path);
}

bool SceneUploads::HasTaken(const std::string& id, const SceneFileState& state) const {
  const absl::StatusOr<std::vector<SceneFile>> taken = service_.ListSceneFiles(id);
  return taken.ok() &&
         std::find(taken->begin(), taken->end(), SceneFile{state.path, state.size_bytes, state.sha256}) != taken->end();
}

absl::StatusOr<std::unique_ptr<ScenePartUpload>> SceneUploads::Begin(const std::string& id, const SceneFilePart& part) {
  MW_RETURN_IF_ERROR(CheckTakesFiles(id));
  MW_RETURN_IF_ERROR(Check(part));
  const std::string state_path = StatePath(id, part.path);
  {
    const MutexLock lock(mutex_);
    if (!busy_.insert(state_path).second) {
      return absl::AbortedError(absl::StrCat("another part of ", part.path, " arrives at the same time"));
    }
  }
  auto upload = std::unique_ptr<ScenePartUpload>(new ScenePartUpload(*this, id, part, state_path));
  std::error_code error;
  fs::create_directories(fs::path(state_path).parent_path(), error);
  std::optional<SceneFileState> before = Load(state_path);
  // It may have been replaced by another way since.
  if (before && before->complete && !HasTaken(id, *before)) before.reset();
  SceneFileState& state = upload->state_;
  state = before.value_or(SceneFileState{.path = part.path});
  const bool same_file = before && state.size_bytes == part.size_bytes && state.sha256 == part.sha256;
  if (same_file && state.complete) {
    upload->kind_ = ScenePartUpload::Kind::kKnown;
    return upload;
  }
  if (!same_file && part.offset_bytes == 0) {
    state = {.path = part.path, .size_bytes = part.size_bytes, .sha256 = part.sha256, .staged_name = state.staged_name};
  }
  const int64_t expected = same_file || part.offset_bytes == 0 ? state.offset_bytes : 0;
  if (part.offset_bytes > expected) return WrongOffset(part.offset_bytes, expected);
  if (part.offset_bytes < state.offset_bytes) upload->kind_ = ScenePartUpload::Kind::kRepeated;
  auto staged = Stage(state_path, state);
  if (absl::IsDataLoss(staged.status())) {
    // The bytes are gone, whoever took them: all of the file again.
    state.offset_bytes = 0;
    MW_RETURN_IF_ERROR(Save(id, state));
    if (part.offset_bytes > 0) return WrongOffset(part.offset_bytes, 0);
    upload->kind_ = ScenePartUpload::Kind::kNew;
    staged = Stage(state_path, state);
  }
  MW_RETURN_IF_ERROR(staged.status());
  upload->staged_ = *std::move(staged);
  if (part.offset_bytes > 0) upload->part_digest_.emplace();
  return upload;
}

ScenePartUpload::ScenePartUpload(SceneUploads& uploads, std::string id, SceneFilePart part, std::string state_path)
    : uploads_(uploads), id_(std::move(id)), part_(std::move(part)), state_path_(std::move(state_path)) {}

ScenePartUpload::~ScenePartUpload() {
  if (staged_ != nullptr && state_.offset_bytes == 0) {
    std::error_code error;
    fs::remove(staged_->path(), error);  // nobody would know of it
  }
  const MutexLock lock(uploads_.mutex_);
  uploads_.busy_.erase(state_path_);
}

absl::Status ScenePartUpload::Append(absl::Span<const uint8_t> bytes) {
  if (kind_ == Kind::kKnown) return absl::OkStatus();
  const int64_t begin = part_.offset_bytes + received_bytes_;
  received_bytes_ += static_cast<int64_t>(bytes.size());
  const int64_t end = part_.offset_bytes + received_bytes_;
  if (kind_ == Kind::kRepeated) {
    if (end > state_.offset_bytes) return WrongOffset(part_.offset_bytes, state_.offset_bytes);
    MW_ASSIGN_OR_RETURN(const std::string there, staged_->Read(begin, bytes.size()));
    if (there.size() == bytes.size() && std::memcmp(there.data(), bytes.data(), bytes.size()) == 0) {
      return absl::OkStatus();
    }
    return WithExpectedOffset(state_.offset_bytes,
                              absl::AbortedError("the part has other bytes than those that came before"));
  }
  if (end > part_.size_bytes) {
    return WithExpectedOffset(state_.offset_bytes,
                              FieldError("size", absl::InvalidArgumentError(absl::StrCat(
                                                     "size is ", part_.size_bytes, ", the part has bytes beyond it"))));
  }
  if (part_digest_) part_digest_->Update(bytes);
  return staged_->Append(bytes);
}

absl::Status ScenePartUpload::CheckPart() const {
  if (part_.part_sha256.empty() && received_bytes_ < part_.size_bytes) {
    return FieldError("partSha256", absl::InvalidArgumentError(absl::StrCat(
                                        "partSha256 is missing, and the part has ", received_bytes_, " of ",
                                        part_.size_bytes, " bytes: expected for a part that is not the whole file")));
  }
  if (part_.part_sha256.empty()) return absl::OkStatus();
  const std::string digest = part_digest_ ? Sha256Stream(*part_digest_).HexDigest() : staged_->HexDigest();
  return digest == part_.part_sha256 ? absl::OkStatus() : WrongDigest("partSha256", part_.part_sha256, digest);
}

absl::StatusOr<SceneFileState> ScenePartUpload::Finish() {
  if (kind_ != Kind::kNew) return state_;
  MW_RETURN_IF_ERROR(WithExpectedOffset(state_.offset_bytes, CheckPart()));
  MW_RETURN_IF_ERROR(staged_->Sync());
  state_.offset_bytes += received_bytes_;
  if (state_.offset_bytes < state_.size_bytes) {
    uploads_.Remember(state_path_, staged_->digest());
    MW_RETURN_IF_ERROR(uploads_.Save(id_, state_));
    return state_;
  }
  return FinishFile();
}

absl::StatusOr<SceneFileState> ScenePartUpload::FinishFile() {
  absl::Status delivered;
  if (const std::string digest = staged_->HexDigest(); digest != state_.sha256) {
    delivered = WrongDigest("sha256", state_.sha256, digest);
    state_.offset_bytes = 0;  // nobody knows which part was wrong
  } else {
    delivered = uploads_.service_.AdoptSceneFile(
        id_, {.path = state_.path, .size_bytes = state_.size_bytes, .digest = state_.sha256}, staged_->path());
  }
  state_.complete = delivered.ok();
  if (delivered.ok()) state_.staged_name.clear();
  if (delivered.ok() || state_.offset_bytes == 0) {
    uploads_.Forget(state_path_);
  } else {
    uploads_.Remember(state_path_, staged_->digest());
  }
  MW_RETURN_IF_ERROR(uploads_.Save(id_, state_));
  MW_RETURN_IF_ERROR(WithExpectedOffset(state_.offset_bytes, delivered));
  return state_;
}

std::optional<int64_t> ExpectedOffsetOf(const absl::Status& status) {
  const auto payload = status.GetPayload(kOffsetPayload);
  int64_t offset = 0;
  if (!payload || !absl::SimpleAtoi(std::string(*payload), &offset)) return std::nullopt;
  return offset;
}

absl::StatusOr<SceneFileState> SceneUploads::Get(const std::string& id, const std::string& path) const {
  MW_RETURN_IF_ERROR(ValidateRelativePath(path));
  MW_ASSIGN_OR_RETURN(const std::vector<SceneFileState> files, List(id));
  for (const SceneFileState& file : files) {
    if (file.path == path) return file;
  }
  return absl::NotFoundError(absl::StrCat("reconstruction ", id, " has no file ", path.substr(0, 128)));
}

absl::StatusOr<std::vector<SceneFileState>> SceneUploads::List(const std::string& id) const {
  MW_ASSIGN_OR_RETURN(const v1::Reconstruction reconstruction, service_.Get(id));
  std::vector<SceneFileState> files;
  if (reconstruction.state() != v1::RECONSTRUCTION_STATE_CREATED) return files;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(absl::StrCat(folder_, "/", id), error)) {
    if (entry.path().extension() != kStateEnding) continue;
    auto state = Load(entry.path());
    if (state && !state->complete) files.push_back(*std::move(state));
  }
  // What is complete the reconstruction says: it may have come by another way.
  MW_ASSIGN_OR_RETURN(const std::vector<SceneFile> taken, service_.ListSceneFiles(id));
  std::set<std::string> begun;
  for (const SceneFileState& file : files) begun.insert(file.path);
  for (const SceneFile& file : taken) {
    if (begun.count(file.path) > 0) continue;  // is being replaced
    files.push_back({.path = file.path,
                     .size_bytes = file.size_bytes,
                     .sha256 = file.digest,
                     .offset_bytes = file.size_bytes,
                     .complete = true});
  }
  std::sort(files.begin(), files.end(), [](const auto& a, const auto& b) { return a.path < b.path; });
  return files;
}

void SceneUploads::Sweep() const {
  std::error_code error;
  std::vector<fs::path> folders;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_, error)) folders.push_back(entry.path());
  for (const fs::path& folder : folders) {
    const absl::Status status = CheckTakesFiles(folder.filename());
    if (absl::IsNotFound(status) || absl::IsFailedPrecondition(status)) RemoveFolder(folder.filename());
  }
  RemoveExpired();
}

void SceneUploads::RemoveExpired() const {
  const auto oldest = fs::file_time_type::clock::now() - absl::ToChronoSeconds(kUnfinishedLifetime);
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(service_.staging_folder(), error)) {
    std::error_code of_file;
    if (!entry.is_regular_file(of_file) || entry.last_write_time(of_file) > oldest || of_file) continue;
    fs::remove(entry.path(), of_file);
  }
}

void SceneUploads::RemoveFolder(const std::string& id) const {
  const fs::path folder = fs::path(folder_) / id;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    const std::optional<SceneFileState> state = Load(entry.path());
    if (state && !state->staged_name.empty()) fs::remove(StagedPath(*state), error);
  }
  fs::remove_all(folder, error);
}

}  // namespace meshwright
