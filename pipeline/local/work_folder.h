// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/base/clock.h"
#include "common/base/folder_lock.h"
#include "common/blob/blob_store.h"
#include "coordinator/store/job_store.h"

namespace meshwright {

// Where one local reconstruction keeps its state: state.sqlite (JobStore), blobs/ (surfaces) and a lock that keeps a
// second process out.
class WorkFolder {
 public:
  // The reconstruction's id in the store.
  static constexpr char kReconstructionId[] = "local";

  // Makes the folder (the one above must exist) or goes on in it. FailedPrecondition: it belongs to another scene or
  // other options (the message says which), or is no work folder of ours; with `restart` what is in it is thrown away
  // first. Unavailable: another process works in it.
  static absl::StatusOr<std::unique_ptr<WorkFolder>> Open(const std::string& path, const std::string& scene_digest,
                                                          const std::string& options_json, bool restart,
                                                          const Clock& clock);
  ~WorkFolder();
  WorkFolder(const WorkFolder&) = delete;
  WorkFolder& operator=(const WorkFolder&) = delete;

  JobStore& store() { return *store_; }
  BlobStore& blobs() { return *blobs_; }
  // For what came out of refining the cameras.
  std::string RefinementPath() const;
  // For the mesh when another format is to be made of it.
  std::string MeshPath() const;
  // Whether there was something to go on from.
  bool resumed() const { return resumed_; }

  // Removes everything in it that is ours, and the folder when it is empty then. store() and blobs() are gone.
  absl::Status Remove();

 private:
  WorkFolder(std::string path, FolderLock lock);
  absl::Status RemoveContents();
  absl::Status OpenStores(const std::string& scene_digest, const std::string& options_json, const Clock& clock);

  const std::string path_;
  const FolderLock lock_;  // outlives the stores
  bool resumed_ = false;
  std::unique_ptr<JobStore> store_;
  std::unique_ptr<BlobStore> blobs_;
};

}  // namespace meshwright
