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
  virtual absl::StatusOr<bool> Has(const std::string& digest) = 0;
  // Deleting what is not there is harmless.
  virtual absl::Status Delete(const std::string& digest) = 0;
};

// InvalidArgument unless `digest` is one that Put could have returned. Get, Has and Delete check it, so that digests
// from outside cannot name anything but blobs.
absl::Status ValidateDigest(const std::string& digest);

}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
