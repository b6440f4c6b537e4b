#pragma once

#include <memory>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/base/digest.h"
#include "common/base/files.h"
#include "common/base/thread_pool.h"
#include "common/blob/blob_store.h"
#include "common/scene/scene.h"

namespace meshwright {

// InvalidArgument (naming the field `path`) unless it is a relative path that stays inside: no "..", no empty part.
absl::Status ValidateRelativePath(const std::string& path);

// The folder that "file:FOLDER" names: below the first of `roots` that has it, symbolic links followed. InvalidArgument
// or NotFound names the field `scene_reference`.
absl::StatusOr<std::string> ResolveSceneReference(const std::string& reference, const std::vector<std::string>& roots);

// A file of a scene that arrives in pieces: there, whole and with its digest, or not at all.
class SceneFileUpload {
 public:
  // The file will be FOLDER/path. Makes the folders.
  static absl::StatusOr<SceneFileUpload> Begin(const std::string& folder, const std::string& path, int64_t size_bytes,
                                               const std::string& sha256);
  absl::Status Append(const std::string& chunk);
  absl::Status Finish();

 private:
  SceneFileUpload(AtomicFile file, std::string path, int64_t size_bytes, std::string sha256);
  AtomicFile file_;
  std::string path_;
  int64_t size_bytes_;
  std::string sha256_;
  int64_t received_ = 0;
  std::unique_ptr<Sha256Stream> digest_ = std::make_unique<Sha256Stream>();
};

struct TakenScene {
  std::string scene_digest;  // as of CheckAndDigestScene
  std::string scene_blob;    // EncodeScene, with the digest of each picture's blob as its image_path
};

// Reads the scene in `folder`, checks every photograph and puts all of it into the BlobStore: from then on the folder
// is not needed any more and nothing that happens to it changes the reconstruction. Errors of the scene are bad input.
absl::StatusOr<TakenScene> TakeScene(const std::string& folder, BlobStore& blobs, ThreadPool& pool);

}  // namespace meshwright
