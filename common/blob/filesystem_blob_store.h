// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/blob/blob_store.h"

namespace meshwright {

// Blobs as files below one folder: ROOT/ab/abcdef... (the first two digits of the digest, then all of it). What is on
// its way lies in ROOT/staging. Files appear whole or not at all, so several processes, also on several machines, may
// share the folder. Errors name the path; ResourceExhausted when the disk is full.
class FilesystemBlobStore : public BlobStore {
 public:
  // Creates the folder (and those above it) when it is not there.
  static absl::StatusOr<std::unique_ptr<FilesystemBlobStore>> Open(const std::string& root);

  absl::StatusOr<std::string> Put(const std::string& bytes) override;
  absl::StatusOr<std::string> Get(const std::string& digest) override;
  absl::StatusOr<std::string> PutFile(const std::string& path) override;
  absl::Status GetFile(const std::string& digest, const std::string& path) override;
  absl::Status Adopt(const std::string& path, const std::string& digest) override;
  std::string staging_folder() const override;
  absl::StatusOr<bool> Has(const std::string& digest) override;
  absl::Status Delete(const std::string& digest) override;

  // Where the blob is or would be. The digest must be valid.
  std::string PathOf(const std::string& digest) const;

 private:
  explicit FilesystemBlobStore(std::string root);
  absl::Status MakeFolderOf(const std::string& path);
  std::string root_;
};

}  // namespace meshwright
