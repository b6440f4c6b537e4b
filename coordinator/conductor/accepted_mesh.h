// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "common/base/thread_pool.h"
#include "common/blob/blob_store.h"
#include "common/job/camera_job_spec.h"
#include "common/mesh/joined_mesh.h"
#include "common/surface/patch_lattice.h"

namespace meshwright {

absl::StatusOr<PatchLattice> LoadAcceptedSurface(BlobStore& blobs, const AcceptedSurface& surface);

// The last step of a reconstruction: the mesh of its accepted surfaces, in the order of their commits, with
// the scene's offset.
absl::StatusOr<JoinedMeshCounts> WriteAcceptedMesh(
    const std::vector<AcceptedSurface>& surfaces, BlobStore& blobs, const JoinOptions& options,
    const Eigen::Vector3d& offset, const std::string& path, ThreadPool& pool,
    const JoinListener& listener = [](double) {});

}  // namespace meshwright
