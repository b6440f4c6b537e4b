// SPDX-License-Identifier: Apache-2.0
#include "common/telemetry/measured_blob_store.h"

#include <filesystem>
#include <system_error>

#include "common/base/clock.h"

namespace meshwright {
namespace {

// 0 where there is no such file.
double SizeOf(const std::string& path) {
  std::error_code error;
  const auto size = std::filesystem::file_size(path, error);
  return error ? 0 : static_cast<double>(size);
}

}  // namespace

MeasuredBlobStore::MeasuredBlobStore(BlobStore& blobs, Metrics& metrics)
    : blobs_(blobs),
      calls_(metrics, "meshwright_blob", "Calls to the blob store"),
      read_bytes_(metrics.Counter("meshwright_blob_read_bytes_total", "Bytes got from the blob store.")),
      written_bytes_(metrics.Counter("meshwright_blob_written_bytes_total", "Bytes put into the blob store.")) {}

absl::StatusOr<std::string> MeasuredBlobStore::Put(const std::string& bytes) {
  const Stopwatch stopwatch;
  absl::StatusOr<std::string> digest = blobs_.Put(bytes);
  calls_.Record("put", stopwatch.Elapsed(), digest.status());
  if (digest.ok()) written_bytes_.Increment(static_cast<double>(bytes.size()));
  return digest;
}

absl::StatusOr<std::string> MeasuredBlobStore::Get(const std::string& digest) {
  const Stopwatch stopwatch;
  absl::StatusOr<std::string> bytes = blobs_.Get(digest);
  calls_.Record("get", stopwatch.Elapsed(), bytes.status());
  if (bytes.ok()) read_bytes_.Increment(static_cast<double>(bytes->size()));
  return bytes;
}

absl::StatusOr<std::string> MeasuredBlobStore::PutFile(const std::string& path) {
  const Stopwatch stopwatch;
  absl::StatusOr<std::string> digest = blobs_.PutFile(path);
  calls_.Record("put", stopwatch.Elapsed(), digest.status());
  if (digest.ok()) written_bytes_.Increment(SizeOf(path));
  return digest;
}

absl::Status MeasuredBlobStore::GetFile(const std::string& digest, const std::string& path) {
  const Stopwatch stopwatch;
  absl::Status status = blobs_.GetFile(digest, path);
  calls_.Record("get", stopwatch.Elapsed(), status);
  if (status.ok()) read_bytes_.Increment(SizeOf(path));
  return status;
}

absl::Status MeasuredBlobStore::Adopt(const std::string& path, const std::string& digest) {
  const double bytes = SizeOf(path);
  const Stopwatch stopwatch;
  absl::Status status = blobs_.Adopt(path, digest);
  calls_.Record("put", stopwatch.Elapsed(), status);
  if (status.ok()) written_bytes_.Increment(bytes);
  return status;
}

absl::StatusOr<bool> MeasuredBlobStore::Has(const std::string& digest) {
  const Stopwatch stopwatch;
  const absl::StatusOr<bool> has = blobs_.Has(digest);
  calls_.Record("has", stopwatch.Elapsed(), has.status());
  return has;
}

absl::Status MeasuredBlobStore::Delete(const std::string& digest) {
  const Stopwatch stopwatch;
  absl::Status status = blobs_.Delete(digest);
  calls_.Record("delete", stopwatch.Elapsed(), status);
  return status;
}

}  // namespace meshwright
