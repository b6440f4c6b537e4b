// SPDX-License-Identifier: Apache-2.0
#include "coordinator/api/scene_upload.h"

#include <filesystem>
#include <system_error>
#include <utility>

#include <absl/strings/str_cat.h>
#include <absl/types/span.h>

#include "common/base/relative_path.h"
#include "common/base/status_macros.h"
#include "common/blob/blob_store.h"

namespace meshwright {

SceneFileUpload::SceneFileUpload(std::unique_ptr<StagedBlob> staged, std::string path, int64_t size_bytes,
                                 std::string sha256, Keep keep)
    : staged_(std::move(staged)),
      path_(std::move(path)),
      size_bytes_(size_bytes),
      sha256_(std::move(sha256)),
      keep_(std::move(keep)) {}

SceneFileUpload::~SceneFileUpload() {
  if (staged_ == nullptr) return;
  std::error_code error;
  std::filesystem::remove(staged_->path(), error);  // unless it was kept
}

absl::StatusOr<SceneFileUpload> SceneFileUpload::Begin(const std::string& folder, const std::string& path,
                                                       int64_t size_bytes, const std::string& sha256, Keep keep) {
  MW_RETURN_IF_ERROR(ValidateRelativePath(path));
  if (size_bytes < 0 || size_bytes > kMaxSceneFileBytes) {
    return absl::InvalidArgumentError(absl::StrCat("size_bytes is ", size_bytes, ", expected 0..", kMaxSceneFileBytes));
  }
  MW_RETURN_IF_ERROR(ValidateDigest(sha256, "sha256"));
  MW_ASSIGN_OR_RETURN(const std::string staged_path, StagedBlob::NewPath(folder));
  MW_ASSIGN_OR_RETURN(std::unique_ptr<StagedBlob> staged, StagedBlob::Open(staged_path));
  return SceneFileUpload(std::move(staged), path, size_bytes, sha256, std::move(keep));
}

absl::Status SceneFileUpload::Append(const std::string& chunk) {
  if (staged_->size_bytes() + static_cast<int64_t>(chunk.size()) > size_bytes_) {
    return absl::InvalidArgumentError(absl::StrCat(path_, ": more bytes than size_bytes, ", size_bytes_));
  }
  return staged_->Append(absl::MakeConstSpan(reinterpret_cast<const uint8_t*>(chunk.data()), chunk.size()));
}

absl::Status SceneFileUpload::Finish() {
  if (staged_->size_bytes() != size_bytes_) {
    return absl::InvalidArgumentError(
        absl::StrCat(path_, ": ", staged_->size_bytes(), " bytes arrived, size_bytes is ", size_bytes_));
  }
  if (const std::string digest = staged_->HexDigest(); digest != sha256_) {
    return absl::InvalidArgumentError(absl::StrCat(path_, ": its bytes have sha256 ", digest, ", not ", sha256_));
  }
  MW_RETURN_IF_ERROR(staged_->Sync());
  return keep_(staged_->path());
}

}  // namespace meshwright
