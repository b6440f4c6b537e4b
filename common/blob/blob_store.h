#pragma once

#include <cstdint>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

namespace meshwright {

// Immutable bytes under the SHA-256 of their content. Putting the same bytes twice is harmless. Thread-safe.
class BlobStore {
 public:
  virtual ~BlobStore() = default;

  // Returns the digest (64 hexadecimal digits) once the bytes are durable.
  virtual absl::StatusOr<std::string> Put(const std::string& bytes) = 0;
  // NotFound, or DataLoss when what is stored does not have this digest: the digest is checked on every read.
  virtual absl::StatusOr<std::string> Get(const std::string& digest) = 0;
  virtual absl::StatusOr<bool> Has(const std::string& digest) = 0;
  virtual absl::Status Delete(const std::string& digest) = 0;
};

}  // namespace meshwright
