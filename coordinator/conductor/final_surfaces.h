#pragma once

#include <functional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "common/base/thread_pool.h"
#include "common/blob/blob_store.h"
#include "common/job/camera_job_spec.h"
#include "coordinator/acceptance/acceptance.h"
#include "coordinator/conductor/conductor.h"

namespace meshwright {

// Stores a surface and gives its digest.
using PutSurface = std::function<absl::StatusOr<std::string>(const std::string& bytes)>;

// Between the last commit and the mesh: every committed surface is judged again by all cameras (JudgeAgain), since
// those behind it had no say. Gives what the mesh is made of, in the order in which parts own what they share: what was
// accepted and stays, in the order of commits, then what has found its supporters since, likewise, less crumbs. A few
// surfaces are in memory at a time. The result depends on the surfaces alone. Errors are those of the blobs.
absl::StatusOr<std::vector<AcceptedSurface>> JudgeCommittedSurfaces(
    const std::vector<CommittedSurface>& committed, const AcceptanceOptions& options, BlobStore& blobs,
    const PutSurface& put, ThreadPool& pool, const std::function<void(int judged)>& progress = [](int) {});

}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
