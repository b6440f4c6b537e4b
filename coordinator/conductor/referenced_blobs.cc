// SPDX-License-Identifier: Apache-2.0
#include "coordinator/conductor/referenced_blobs.h"

#include <absl/strings/str_cat.h>
#include <absl/time/clock.h>

#include "common/base/digest.h"
#include "common/base/status_macros.h"

namespace meshwright {
namespace {

constexpr absl::Duration kPause = absl::Milliseconds(100);
constexpr int kMaxPauses = 600;

}  // namespace

absl::Status ReferencedBlobs::Hold(const std::string& digest) {
  for (int pauses = 0; pauses < kMaxPauses; ++pauses) {
    MW_ASSIGN_OR_RETURN(const bool may_be_put, store_.AddBlobRef(reconstruction_, digest));
    if (may_be_put) return absl::OkStatus();
    absl::SleepFor(kPause);
  }
  return absl::UnavailableError(absl::StrCat("blob ", digest, " is being deleted with another reconstruction"));
}

absl::StatusOr<std::string> ReferencedBlobs::Put(const std::string& bytes) {
  MW_RETURN_IF_ERROR(Hold(Sha256Hex(bytes)));
  return blobs_.Put(bytes);
}

absl::Status ReferencedBlobs::PutFile(const std::string& path, const std::string& digest) {
  MW_RETURN_IF_ERROR(Hold(digest));
  MW_ASSIGN_OR_RETURN(const std::string put, blobs_.PutFile(path));
  if (put != digest) return absl::AbortedError(absl::StrCat(path, ": it has changed meanwhile"));
  return absl::OkStatus();
}

absl::Status ReferencedBlobs::Adopt(const std::string& path, const std::string& digest) {
  MW_RETURN_IF_ERROR(Hold(digest));
  return blobs_.Adopt(path, digest);
}

}  // namespace meshwright
