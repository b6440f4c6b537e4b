#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/base/digest.h"
#include "common/base/files.h"

namespace meshwright {

// A file of a scene that arrives in pieces: there, whole and with its digest, or not at all.
class SceneFileUpload {
 public:
  // Takes the file where it lies, whole and checked, e.g. into the BlobStore.
  using Keep = std::function<absl::Status(const std::string& local_path)>;

  // Pieces are collected in a file of their own in `folder`, which is there. InvalidArgument names the field.
  static absl::StatusOr<SceneFileUpload> Begin(const std::string& folder, const std::string& path, int64_t size_bytes,
                                               const std::string& sha256, Keep keep);
  absl::Status Append(const std::string& chunk);
  absl::Status Finish();

 private:
  SceneFileUpload(AtomicFile file, std::string local_path, std::string path, int64_t size_bytes, std::string sha256,
                  Keep keep);
  AtomicFile file_;
  std::string local_path_;
  std::string path_;
  int64_t size_bytes_;
  std::string sha256_;
  Keep keep_;
  int64_t received_ = 0;
  std::unique_ptr<Sha256Stream> digest_ = std::make_unique<Sha256Stream>();
};

}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
