// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include <absl/types/span.h>

#include "common/blob/blob_store.h"
#include "common/blob/s3_client.h"

namespace meshwright {

// Blobs as objects of a bucket: PREFIXab/abcdef... (the first two digits of the digest, then all of it). Errors name
// the object's address; those of the network and of a busy server are tried again first.
class S3BlobStore : public BlobStore {
 public:
  // The bucket must exist (FailedPrecondition), and the keys must allow listing it (PermissionDenied): S3 says
  // "forbidden" instead of "not found" to those who may not.
  static absl::StatusOr<std::unique_ptr<S3BlobStore>> Open(const S3Options& options);

  absl::StatusOr<std::string> Put(const std::string& bytes) override;
  absl::StatusOr<std::string> Get(const std::string& digest) override;
  // Sends the file from where it lies: what fits into one request is neither held in memory nor hashed again.
  absl::Status Adopt(const std::string& path, const std::string& digest) override;
  absl::StatusOr<bool> Has(const std::string& digest) override;
  absl::Status Delete(const std::string& digest) override;

  // The key of the blob's object, after the prefix. The digest must be valid.
  static std::string KeyOf(const std::string& digest);

 private:
  explicit S3BlobStore(const S3Options& options) : client_(options) {}
  absl::Status PutObject(const std::string& digest, absl::Span<const uint8_t> bytes);
  absl::Status PutInParts(const std::string& key, absl::Span<const uint8_t> bytes);
  absl::StatusOr<std::string> UploadParts(const std::string& key, const std::string& upload_id,
                                          absl::Span<const uint8_t> bytes);

  S3Client client_;
};

}  // namespace meshwright
