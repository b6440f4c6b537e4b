// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/types/span.h>

#include "common/base/digest.h"
#include "common/blob/blob_store.h"

namespace meshwright {

// Bytes on their way into a BlobStore: written once, and hashed while they come. They lie in a file of their own, which
// stays when the process dies; Adopt() makes it the blob. Errors do not name the file: they may go to whoever sends.
class StagedBlob {
 public:
  // A name that no other file in `folder` has; the folder is made where it is not there.
  static absl::StatusOr<std::string> NewPath(const std::string& folder);
  // Goes on behind the first `kept_bytes` of the file, whose digest so far is `kept`; what else is in it goes.
  // DataLoss when it has fewer bytes; where none are kept the file is made.
  static absl::StatusOr<std::unique_ptr<StagedBlob>> Open(const std::string& path, int64_t kept_bytes = 0,
                                                          Sha256Stream kept = {});
  // The digest of a file's first bytes, for Open(). Reads them: who kept it needs this only after a restart.
  static absl::StatusOr<Sha256Stream> DigestOf(const std::string& path, int64_t bytes);
  StagedBlob(const StagedBlob&) = delete;
  StagedBlob& operator=(const StagedBlob&) = delete;
  ~StagedBlob();

  absl::Status Append(absl::Span<const uint8_t> bytes);
  // As many bytes as there are, at most `count`.
  absl::StatusOr<std::string> Read(int64_t offset, size_t count) const;
  // From now on what was appended survives a power cut.
  absl::Status Sync();
  // After Sync().
  absl::Status Adopt(BlobStore& blobs) const { return blobs.Adopt(path_, HexDigest()); }

  const std::string& path() const { return path_; }
  int64_t size_bytes() const { return size_bytes_; }
  // Of all bytes so far.
  const Sha256Stream& digest() const { return digest_; }
  std::string HexDigest() const { return Sha256Stream(digest_).HexDigest(); }

 private:
  StagedBlob(std::string path, int descriptor, int64_t size_bytes, Sha256Stream digest);
  const std::string path_;
  const int descriptor_;
  int64_t size_bytes_;
  Sha256Stream digest_;
};

}  // namespace meshwright
