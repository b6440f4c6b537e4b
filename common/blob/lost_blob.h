// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/blob/blob_store.h"

namespace meshwright {

// Passes a BlobStore on. Errors that mean that a blob is damaged or lost (DataLoss, NotFound) carry its digest, however
// far up they are returned: LostBlobOf() tells it.
class LostBlobNamer : public BlobStore {
 public:
  // `blobs` outlives it.
  explicit LostBlobNamer(BlobStore& blobs) : blobs_(blobs) {}

  absl::StatusOr<std::string> Put(const std::string& bytes) override { return blobs_.Put(bytes); }
  absl::StatusOr<std::string> Get(const std::string& digest) override;
  absl::StatusOr<std::string> PutFile(const std::string& path) override { return blobs_.PutFile(path); }
  absl::Status GetFile(const std::string& digest, const std::string& path) override;
  absl::Status Adopt(const std::string& path, const std::string& digest) override { return blobs_.Adopt(path, digest); }
  std::string staging_folder() const override { return blobs_.staging_folder(); }
  absl::StatusOr<bool> Has(const std::string& digest) override { return blobs_.Has(digest); }
  absl::Status Delete(const std::string& digest) override { return blobs_.Delete(digest); }

 private:
  BlobStore& blobs_;
};

// The digest of the blob that is damaged or lost; "" for any other status.
std::string LostBlobOf(const absl::Status& status);

// Whether this error of a BlobStore means that the blob is damaged or lost.
bool IsBlobLost(const absl::Status& status);

}  // namespace meshwright
