// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/blob/blob_store.h"
#include "coordinator/store/job_store.h"

namespace meshwright {

// Puts blobs that belong to one reconstruction: says so in the store first, so that nobody who deletes another one
// takes them away, and waits while that is just happening. Thread-safe.
class ReferencedBlobs {
 public:
  // Both outlive it.
  ReferencedBlobs(std::string reconstruction, JobStore& store, BlobStore& blobs)
      : reconstruction_(std::move(reconstruction)), store_(store), blobs_(blobs) {}

  absl::StatusOr<std::string> Put(const std::string& bytes);
  // Of a file whose digest is known.
  absl::Status PutFile(const std::string& path, const std::string& digest);
  // See BlobStore::Adopt.
  absl::Status Adopt(const std::string& path, const std::string& digest);
  // Of a blob that is there already, and another reconstruction's.
  absl::Status Hold(const std::string& digest);

 private:
  const std::string reconstruction_;
  JobStore& store_;
  BlobStore& blobs_;
};

}  // namespace meshwright
