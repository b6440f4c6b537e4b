// SPDX-License-Identifier: Apache-2.0
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

// What has become of one camera's filtered surface, in patches.
struct JudgedCamera {
  CameraIndex camera = 0;
  int64_t kept = 0;          // accepted when it was committed, or supported since
  int64_t inferred = 0;      // of these, by planes around textureless holes
  int64_t contradicted = 0;  // other cameras look through it
  int64_t unsupported = 0;   // found by too few others
};

struct JudgedSurfaces {
  std::vector<AcceptedSurface> surfaces;
  std::vector<JudgedCamera> cameras;  // of all committed surfaces, in the order of commits
};

// Between the last commit and the mesh: every committed surface is judged again by all cameras (JudgeAgain), since
// those behind it had no say. Gives what the mesh is made of, in the order in which parts own what they share: what was
// accepted and stays, in the order of commits, then what has found its supporters since, likewise, less crumbs. A few
// surfaces are in memory at a time. The result depends on the surfaces alone. Errors are those of the blobs.
absl::StatusOr<JudgedSurfaces> JudgeCommittedSurfaces(
    const std::vector<CommittedSurface>& committed, const AcceptanceOptions& options, BlobStore& blobs,
    const PutSurface& put, ThreadPool& pool, const std::function<void(int judged)>& progress = [](int) {});

}  // namespace meshwright
