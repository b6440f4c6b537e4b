#include "coordinator/rest/scene_uploads.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <optional>
#include <utility>

#include <absl/strings/cord.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include "common/base/digest.h"
#include "common/base/files.h"
#include "common/base/relative_path.h"
#include "common/base/status_macros.h"
#include "coordinator/api/reconstruction_record.h"
#include "coordinator/api/scene_upload.h"
#include "coordinator/rest/problem.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

constexpr char kOffsetPayload[] = "meshwright/upload-offset";
constexpr char kStateEnding[] = ".json";
constexpr char kBytesEnding[] = ".part";
constexpr size_t kPieceBytes = size_t{256} << 10;
constexpr size_t kMaxPathLength = 1024;

absl::Status CheckDigestText(const std::string& field, const std::string& text) {
  const bool good = text.size() == 64 && text.find_first_not_of("0123456789abcdef") == std::string::npos;
  if (good) return absl::OkStatus();
  return FieldError(field, absl::InvalidArgumentError(absl::StrCat(field, " is \"", text.substr(0, 64),
                                                                   "\", expected 64 lower-case hexadecimal digits")));
}

absl::Status Check(const SceneFilePart& part) {
  if (part.path.size() > kMaxPathLength) {
    return absl::InvalidArgumentError(
        absl::StrCat("path has ", part.path.size(), " characters, expected at most ", kMaxPathLength));
  }
  MW_RETURN_IF_ERROR(ValidateRelativePath(part.path));
  MW_RETURN_IF_ERROR(CheckDigestText("sha256", part.sha256));
  if (!part.part_sha256.empty()) MW_RETURN_IF_ERROR(CheckDigestText("partSha256", part.part_sha256));
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
  return nlohmann::json({{"path", state.path},
                         {"size_bytes", state.size_bytes},
                         {"sha256", state.sha256},
                         {"offset_bytes", state.offset_bytes},
                         {"complete", state.complete}})
      .dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
}

std::optional<SceneFileState> Decode(const std::string& text) {
  const nlohmann::json json = nlohmann::json::parse(text, nullptr, false);
  if (!json.is_object() || !json.contains("path") || !json["path"].is_string()) return std::nullopt;
  return SceneFileState{.path = json["path"],
                        .size_bytes = json.value("size_bytes", int64_t{0}),
                        .sha256 = json.value("sha256", ""),
                        .offset_bytes = json.value("offset_bytes", int64_t{0}),
                        .complete = json.value("complete", false)};
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

// The bytes of a file that is not complete.
class PartialFile {
 public:
  static absl::StatusOr<std::unique_ptr<PartialFile>> Open(const std::string& path) {
    const int descriptor = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
    if (descriptor < 0) return absl::ErrnoToStatus(errno, "the parts of a file cannot be kept");
    return std::unique_ptr<PartialFile>(new PartialFile(descriptor));
  }
  PartialFile(const PartialFile&) = delete;
  PartialFile& operator=(const PartialFile&) = delete;
  ~PartialFile() { ::close(descriptor_); }

  absl::Status Write(absl::Span<const uint8_t> bytes, int64_t offset) {
    while (!bytes.empty()) {
      const ssize_t written = ::pwrite(descriptor_, bytes.data(), bytes.size(), offset);
      if (written < 0 && errno == EINTR) continue;
      if (written < 0) return absl::ErrnoToStatus(errno, "the parts of a file cannot be kept");
      bytes.remove_prefix(static_cast<size_t>(written));
      offset += written;
    }
    return absl::OkStatus();
  }
  // As many bytes as there are, at most `count`.
  absl::StatusOr<std::string> Read(int64_t offset, size_t count) const {
    std::string bytes(count, '\0');
    size_t done = 0;
    while (done < count) {
      const ssize_t got = ::pread(descriptor_, &bytes[done], count - done, offset + static_cast<int64_t>(done));
      if (got < 0 && errno == EINTR) continue;
      if (got < 0) return absl::ErrnoToStatus(errno, "the parts of a file cannot be read");
      if (got == 0) break;
      done += static_cast<size_t>(got);
    }
    bytes.resize(done);
    return bytes;
  }
  absl::Status Sync() {
    if (::fdatasync(descriptor_) != 0) return absl::ErrnoToStatus(errno, "the parts of a file cannot be kept");
    return absl::OkStatus();
  }

 private:
  explicit PartialFile(int descriptor) : descriptor_(descriptor) {}
  const int descriptor_;
};

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

absl::Status SceneUploads::Deliver(const std::string& id, const SceneFileState& state) const {
  v1::UploadSceneFileRequest::Header header;
  header.set_reconstruction_id(id);
  header.set_path(state.path);
  header.set_size_bytes(state.size_bytes);
  header.set_sha256(state.sha256);
  MW_ASSIGN_OR_RETURN(SceneFileUpload upload, service_.BeginUpload(header));
  MW_ASSIGN_OR_RETURN(const auto file, PartialFile::Open(StatePath(id, state.path) + kBytesEnding));
  Sha256Stream stream;
  for (int64_t offset = 0; offset < state.size_bytes;) {
    MW_ASSIGN_OR_RETURN(const std::string piece, file->Read(offset, kPieceBytes));
    if (piece.empty()) break;  // the digest says so
    const std::string bytes = piece.substr(
        0, static_cast<size_t>(std::min<int64_t>(static_cast<int64_t>(piece.size()), state.size_bytes - offset)));
    stream.Update(absl::MakeConstSpan(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()));
    MW_RETURN_IF_ERROR(upload.Append(bytes));
    offset += static_cast<int64_t>(bytes.size());
  }
  const std::string digest = stream.HexDigest();
  if (digest != state.sha256) return WrongDigest("sha256", state.sha256, digest);
  return upload.Finish();
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
    const std::lock_guard<std::mutex> lock(mutex_);
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
    state = {.path = part.path, .size_bytes = part.size_bytes, .sha256 = part.sha256};
  }
  const int64_t expected = same_file || part.offset_bytes == 0 ? state.offset_bytes : 0;
  if (part.offset_bytes > expected) return WrongOffset(part.offset_bytes, expected);
  MW_ASSIGN_OR_RETURN(upload->file_, PartialFile::Open(state_path + kBytesEnding));
  if (part.offset_bytes < state.offset_bytes) upload->kind_ = ScenePartUpload::Kind::kRepeated;
  return upload;
}

ScenePartUpload::ScenePartUpload(SceneUploads& uploads, std::string id, SceneFilePart part, std::string state_path)
    : uploads_(uploads), id_(std::move(id)), part_(std::move(part)), state_path_(std::move(state_path)) {}

ScenePartUpload::~ScenePartUpload() {
  const std::lock_guard<std::mutex> lock(uploads_.mutex_);
  uploads_.busy_.erase(state_path_);
}

absl::Status ScenePartUpload::Append(absl::Span<const uint8_t> bytes) {
  if (kind_ == Kind::kKnown) return absl::OkStatus();
  const int64_t begin = part_.offset_bytes + received_bytes_;
  received_bytes_ += static_cast<int64_t>(bytes.size());
  const int64_t end = part_.offset_bytes + received_bytes_;
  if (kind_ == Kind::kRepeated) {
    if (end > state_.offset_bytes) return WrongOffset(part_.offset_bytes, state_.offset_bytes);
    MW_ASSIGN_OR_RETURN(const std::string there, file_->Read(begin, bytes.size()));
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
  digest_.Update(bytes);
  return file_->Write(bytes, begin);
}

absl::StatusOr<SceneFileState> ScenePartUpload::Finish() {
  if (kind_ != Kind::kNew) return state_;
  const std::string digest = digest_.HexDigest();
  if (!part_.part_sha256.empty()) {
    if (digest != part_.part_sha256) {
      return WithExpectedOffset(state_.offset_bytes, WrongDigest("partSha256", part_.part_sha256, digest));
    }
  } else if (received_bytes_ < part_.size_bytes) {
    return WithExpectedOffset(
        state_.offset_bytes,
        FieldError("partSha256", absl::InvalidArgumentError(absl::StrCat(
                                     "partSha256 is missing, and the part has ", received_bytes_, " of ",
                                     part_.size_bytes, " bytes: expected for a part that is not the whole file"))));
  }
  MW_RETURN_IF_ERROR(file_->Sync());
  state_.offset_bytes += received_bytes_;
  if (state_.offset_bytes < state_.size_bytes) {
    MW_RETURN_IF_ERROR(uploads_.Save(id_, state_));
    return state_;
  }
  const absl::Status delivered = uploads_.Deliver(id_, state_);
  if (HttpStatusOf(delivered) == 422) state_.offset_bytes = 0;  // nobody knows which part was wrong
  state_.complete = delivered.ok();
  MW_RETURN_IF_ERROR(uploads_.Save(id_, state_));
  MW_RETURN_IF_ERROR(WithExpectedOffset(state_.offset_bytes, delivered));
  std::error_code error;
  fs::remove(state_path_ + kBytesEnding, error);
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
    if (absl::IsNotFound(status) || absl::IsFailedPrecondition(status)) fs::remove_all(folder, error);
  }
}

}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
