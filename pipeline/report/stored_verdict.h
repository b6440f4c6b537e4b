// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "common/blob/blob_store.h"
#include "coordinator/conductor/final_surfaces.h"
#include "coordinator/store/job_store.h"

namespace meshwright {

// The verdict (MakeVerdict) of a service's reconstruction whose surfaces have been judged, as the JSON text that is
// kept with its mesh: with "summary" and "warning" in words. Errors are those of the store and of the scene's blob.
absl::StatusOr<std::string> MakeStoredVerdict(const std::string& id, const std::vector<JudgedCamera>& judged,
                                              JobStore& store, BlobStore& blobs);

}  // namespace meshwright
