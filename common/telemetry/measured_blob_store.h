// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <prometheus/counter.h>

#include "common/blob/blob_store.h"
#include "common/telemetry/metrics.h"

namespace meshwright {

// Another BlobStore, with meshwright_blob_seconds{operation}, meshwright_blob_errors_total{operation, code} and
// meshwright_blob_read_bytes_total, meshwright_blob_written_bytes_total.
class MeasuredBlobStore final : public BlobStore {
 public:
  // Both outlive it.
  MeasuredBlobStore(BlobStore& blobs, Metrics& metrics);

  absl::StatusOr<std::string> Put(const std::string& bytes) override;
  absl::StatusOr<std::string> Get(const std::string& digest) override;
  absl::StatusOr<std::string> PutFile(const std::string& path) override;
  absl::Status GetFile(const std::string& digest, const std::string& path) override;
  absl::Status Adopt(const std::string& path, const std::string& digest) override;
  std::string staging_folder() const override { return blobs_.staging_folder(); }
  absl::StatusOr<bool> Has(const std::string& digest) override;
  absl::Status Delete(const std::string& digest) override;

 private:
  BlobStore& blobs_;
  CallMetrics calls_;
  prometheus::Counter& read_bytes_;
  prometheus::Counter& written_bytes_;
};

}  // namespace meshwright
