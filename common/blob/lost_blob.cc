// SPDX-License-Identifier: Apache-2.0
#include "common/blob/lost_blob.h"

#include <optional>

#include <absl/strings/cord.h>

namespace meshwright {
namespace {

constexpr char kPayload[] = "meshwright/lost-blob";

absl::Status Named(absl::Status status, const std::string& digest) {
  if (IsBlobLost(status)) status.SetPayload(kPayload, absl::Cord(digest));
  return status;
}

}  // namespace

absl::StatusOr<std::string> LostBlobNamer::Get(const std::string& digest) {
  absl::StatusOr<std::string> bytes = blobs_.Get(digest);
  if (!bytes.ok()) return Named(bytes.status(), digest);
  return bytes;
}

absl::Status LostBlobNamer::GetFile(const std::string& digest, const std::string& path) {
  return Named(blobs_.GetFile(digest, path), digest);
}

std::string LostBlobOf(const absl::Status& status) {
  const auto payload = status.GetPayload(kPayload);
  return payload ? std::string(*payload) : std::string();
}

bool IsBlobLost(const absl::Status& status) { return absl::IsDataLoss(status) || absl::IsNotFound(status); }

}  // namespace meshwright
