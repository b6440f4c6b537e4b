// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

namespace meshwright {

// Immutable bytes under the SHA-256 of their content. Putting the same bytes twice is harmless. Thread-safe. Every
// implementation passes blob_store_conformance.h.
class BlobStore {
 public:
  virtual ~BlobStore() = default;

  // Returns the digest (64 lower-case hexadecimal digits) once the bytes are durable. Mends a damaged blob.
  virtual absl::StatusOr<std::string> Put(const std::string& bytes) = 0;
  // NotFound, or DataLoss when what is stored does not have this digest: the digest is checked on every read.
  virtual absl::StatusOr<std::string> Get(const std::string& digest) = 0;
  // The same for a file, so that large ones need not be in memory where the store can do without: Put of its bytes, and
  // Get into a file that appears whole or not at all.
  virtual absl::StatusOr<std::string> PutFile(const std::string& path);
  virtual absl::Status GetFile(const std::string& digest, const std::string& path);
  // Takes over a file that was hashed and synced while it was written (StagedBlob): once it returns OK the blob is
  // durable and the file is gone. Bytes of another digest would be a damaged blob. A file in staging_folder() is moved,
  // not copied; the folder need not be there yet. "": the store has none, any folder will do.
  virtual absl::Status Adopt(const std::string& path, const std::string& digest);
  virtual std::string staging_folder() const { return ""; }
  virtual absl::StatusOr<bool> Has(const std::string& digest) = 0;
  // Deleting what is not there is harmless.
  virtual absl::Status Delete(const std::string& digest) = 0;
};

// InvalidArgument, calling it `name`, unless `digest` is one that Put could have returned. Get, Has and Delete check
// it, so that digests from outside cannot name anything but blobs.
absl::Status ValidateDigest(const std::string& digest, const std::string& name = "blob digest");

}  // namespace meshwright
