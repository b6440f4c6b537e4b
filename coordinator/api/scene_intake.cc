#include "coordinator/api/scene_intake.h"

#include <atomic>
#include <filesystem>
#include <optional>
#include <utility>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>
#include <unistd.h>

#include "common/base/bad_input.h"
#include "common/base/status_macros.h"
#include "common/blob/lost_blob.h"
#include "common/scene/import.h"
#include "common/scene/scene_check.h"
#include "common/scene/scene_codec.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

constexpr char kFileScheme[] = "file:";
constexpr size_t kMaxPathLength = 1024;
constexpr int64_t kMaxFileBytes = int64_t{1} << 40;

bool IsBelow(const fs::path& path, const fs::path& root) {
  auto at = path.begin();
  for (const fs::path& part : root) {
    if (part.empty()) continue;  // a "/" at the end
    if (at == path.end() || *at != part) return false;
    ++at;
  }
  return true;
}

}  // namespace

absl::Status ValidateRelativePath(const std::string& path) {
  bool valid = !path.empty() && path.size() <= kMaxPathLength && path.find('\0') == std::string::npos;
  for (const std::string& part : std::vector<std::string>(absl::StrSplit(path, '/'))) {
    valid = valid && !part.empty() && part != "." && part != "..";
  }
  if (valid) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("path \"", path.substr(0, 100), "\": a relative path inside the scene's folder expected"));
}

absl::StatusOr<std::string> ResolveSceneReference(const std::string& reference, const std::vector<std::string>& roots) {
  if (!absl::StartsWith(reference, kFileScheme)) {
    return absl::InvalidArgumentError(
        absl::StrCat("scene_reference is \"", reference, "\", expected file:FOLDER below a root of scenes"));
  }
  const std::string relative = reference.substr(sizeof(kFileScheme) - 1);
  if (const absl::Status valid = ValidateRelativePath(relative); !valid.ok()) {
    return absl::InvalidArgumentError(absl::StrCat("scene_reference: ", std::string(valid.message())));
  }
  for (const std::string& root : roots) {
    std::error_code error;
    const fs::path real_root = fs::canonical(root, error);
    if (error) continue;
    const fs::path real = fs::canonical(real_root / relative, error);
    if (error || !fs::is_directory(real, error)) continue;
    if (IsBelow(real, real_root)) return real.string();
  }
  return absl::NotFoundError(
      absl::StrCat("scene_reference \"", reference, "\": no such folder below the ", roots.size(), " roots of scenes"));
}

SceneFileUpload::SceneFileUpload(AtomicFile file, std::string local_path, std::string path, int64_t size_bytes,
                                 std::string sha256, Keep keep)
    : file_(std::move(file)),
      local_path_(std::move(local_path)),
      path_(std::move(path)),
      size_bytes_(size_bytes),
      sha256_(std::move(sha256)),
      keep_(std::move(keep)) {}

absl::StatusOr<SceneFileUpload> SceneFileUpload::Begin(const std::string& folder, const std::string& path,
                                                       int64_t size_bytes, const std::string& sha256, Keep keep) {
  MW_RETURN_IF_ERROR(ValidateRelativePath(path));
  if (size_bytes < 0 || size_bytes > kMaxFileBytes) {
    return absl::InvalidArgumentError(absl::StrCat("size_bytes is ", size_bytes, ", expected 0..", kMaxFileBytes));
  }
  if (!ValidateDigest(sha256).ok()) {
    return absl::InvalidArgumentError("sha256: 64 lower-case hexadecimal digits expected");
  }
  static std::atomic<int64_t> counter{0};
  const std::string local_path = absl::StrCat(folder, "/", ::getpid(), "-", counter++);
  MW_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::Create(local_path));
  return SceneFileUpload(std::move(file), local_path, path, size_bytes, sha256, std::move(keep));
}

absl::Status SceneFileUpload::Append(const std::string& chunk) {
  received_ += static_cast<int64_t>(chunk.size());
  if (received_ > size_bytes_) {
    return absl::InvalidArgumentError(absl::StrCat(path_, ": more bytes than size_bytes, ", size_bytes_));
  }
  digest_->Update(absl::MakeConstSpan(reinterpret_cast<const uint8_t*>(chunk.data()), chunk.size()));
  return file_.Append(chunk);
}

absl::Status SceneFileUpload::Finish() {
  if (received_ != size_bytes_) {
    return absl::InvalidArgumentError(
        absl::StrCat(path_, ": ", received_, " bytes arrived, size_bytes is ", size_bytes_));
  }
  if (const std::string digest = digest_->HexDigest(); digest != sha256_) {
    return absl::InvalidArgumentError(absl::StrCat(path_, ": its bytes have sha256 ", digest, ", not ", sha256_));
  }
  MW_RETURN_IF_ERROR(file_.Commit());
  const absl::Status kept = keep_(local_path_);
  std::error_code error;
  fs::remove(local_path_, error);
  return kept;
}

absl::StatusOr<TakenScene> TakeScene(const std::string& folder, HeldBlobs& blobs, ThreadPool& pool) {
  absl::StatusOr<Scene> scene = ImportScene(folder, std::nullopt);
  if (!scene.ok()) return BadInput(scene.status());
  TakenScene taken;
  MW_ASSIGN_OR_RETURN(taken.scene_digest, CheckAndDigestScene(*scene, pool, [](int) {}));
  for (SceneView& view : scene->views) {
    MW_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(view.image_path));
    MW_ASSIGN_OR_RETURN(view.image_path, blobs.Put(bytes));
  }
  MW_ASSIGN_OR_RETURN(taken.scene_blob, blobs.Put(EncodeScene(*scene)));
  return taken;
}

absl::Status LayOutScene(const std::vector<SceneFile>& files, BlobStore& blobs, const std::string& folder) {
  std::error_code error;
  fs::remove_all(folder, error);
  fs::create_directories(folder, error);
  if (error) return absl::PermissionDeniedError(absl::StrCat(folder, ": cannot make the folder: ", error.message()));
  for (const SceneFile& file : files) {
    const fs::path path = fs::path(folder) / file.path;
    fs::create_directories(path.parent_path(), error);
    if (error) {
      return BadInput(absl::InvalidArgumentError(
          absl::StrCat("path \"", file.path, "\": cannot make its folder: ", error.message())));
    }
    const absl::Status got = blobs.GetFile(file.digest, path.string());
    if (IsBlobLost(got)) {
      return absl::DataLossError(
          absl::StrCat("the uploaded file ", file.path, " is damaged or lost (blob ", file.digest, ")"));
    }
    MW_RETURN_IF_ERROR(got);
  }
  return absl::OkStatus();
}

}  // namespace meshwright
