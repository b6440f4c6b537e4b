#include "coordinator/api/scene_upload.h"

#include <atomic>
#include <filesystem>
#include <utility>

#include <absl/strings/str_cat.h>
#include <unistd.h>

#include "common/base/relative_path.h"
#include "common/base/status_macros.h"
#include "common/blob/blob_store.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kMaxFileBytes = int64_t{1} << 40;

}  // namespace

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

}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
