// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/blob/staged_blob.h"

namespace meshwright {

constexpr int64_t kMaxSceneFileBytes = int64_t{1} << 40;

// A file of a scene that arrives in pieces: there, whole and with its digest, or not at all.
class SceneFileUpload {
 public:
  // Takes the file where it lies, whole and checked, into the BlobStore.
  using Keep = std::function<absl::Status(const std::string& staged_path)>;

  // Pieces are collected in a file of their own in `folder`. InvalidArgument names the field.
  static absl::StatusOr<SceneFileUpload> Begin(const std::string& folder, const std::string& path, int64_t size_bytes,
                                               const std::string& sha256, Keep keep);
  SceneFileUpload(SceneFileUpload&&) = default;
  SceneFileUpload& operator=(SceneFileUpload&&) = delete;
  ~SceneFileUpload();

  absl::Status Append(const std::string& chunk);
  absl::Status Finish();

 private:
  SceneFileUpload(std::unique_ptr<StagedBlob> staged, std::string path, int64_t size_bytes, std::string sha256,
                  Keep keep);
  std::unique_ptr<StagedBlob> staged_;
  std::string path_;
  int64_t size_bytes_;
  std::string sha256_;
  Keep keep_;
};

}  // namespace meshwright
