// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/base/thread_pool.h"
#include "common/blob/blob_store.h"
#include "common/scene/scene.h"
#include "coordinator/conductor/referenced_blobs.h"
#include "coordinator/store/job_store.h"

namespace meshwright {

// The folder that "file:FOLDER" names: below the first of `roots` that has it, symbolic links followed. InvalidArgument
// or NotFound names the field `scene_reference`.
absl::StatusOr<std::string> ResolveSceneReference(const std::string& reference, const std::vector<std::string>& roots);

struct IngestedScene {
  std::string scene_digest;  // as of CheckAndDigestScene
  std::string scene_blob;    // EncodeScene, with the digest of each picture's blob as its image_path
};

// The one of `roots` that `folder`, as ResolveSceneReference gives it, is below; `folder` itself when there is none.
std::string SceneRootOf(const std::string& folder, const std::vector<std::string>& roots);

// Bad input when something in `folder` leads out of `root`, which has the folder in it. Call it before anything is
// read.
absl::Status CheckConfined(const std::string& folder, const std::string& root);

// Reads the scene in `folder`. Its errors are bad input; they call its files by their paths in the folder.
absl::StatusOr<Scene> ReadScene(const std::string& folder);

// Checks every photograph of a scene in `folder` and puts all of it into the BlobStore: from then on the folder is not
// needed any more and nothing that happens to it changes the reconstruction. No photograph is read outside of `root`,
// whatever names and links say. Errors as those of ReadScene.
absl::StatusOr<IngestedScene> IngestScene(Scene scene, const std::string& folder, const std::string& root,
                                          ReferencedBlobs& blobs, ThreadPool& pool);

// Makes `folder` anew with the files of an upload. DataLoss names a file whose blob is damaged or lost.
absl::Status MaterializeScene(const std::vector<SceneFile>& files, BlobStore& blobs, const std::string& folder);

}  // namespace meshwright
