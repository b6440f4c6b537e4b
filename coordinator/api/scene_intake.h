#pragma once

#include <functional>
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
#include "coordinator/api/held_blobs.h"
#include "coordinator/store/job_store.h"

namespace meshwright {

// InvalidArgument (naming the field `path`) unless it is a relative path that stays inside: no "..", no empty part.
absl::Status ValidateRelativePath(const std::string& path);

// The folder that "file:FOLDER" names: below the first of `roots` that has it, symbolic links followed. InvalidArgument
// or NotFound names the field `scene_reference`.
absl::StatusOr<std::string> ResolveSceneReference(const std::string& reference, const std::vector<std::string>& roots);

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

struct TakenScene {
  std::string scene_digest;  // as of CheckAndDigestScene
  std::string scene_blob;    // EncodeScene, with the digest of each picture's blob as its image_path
};

// Reads the scene in `folder`, checks every photograph and puts all of it into the BlobStore: from then on the folder
// is not needed any more and nothing that happens to it changes the reconstruction. Errors of the scene are bad input.
absl::StatusOr<TakenScene> TakeScene(const std::string& folder, HeldBlobs& blobs, ThreadPool& pool);

// Makes `folder` anew with the files of an upload. DataLoss names a file whose blob is damaged or lost.
absl::Status LayOutScene(const std::vector<SceneFile>& files, BlobStore& blobs, const std::string& folder);

}  // namespace meshwright
