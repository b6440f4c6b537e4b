// SPDX-License-Identifier: Apache-2.0
#include "coordinator/conductor/accepted_mesh.h"

#include "common/base/status_macros.h"
#include "common/surface/codec.h"
#include "common/surface/surface_cache.h"

namespace meshwright {
namespace {

// Decoded surfaces kept while they are joined: each is read several times.
constexpr int64_t kCacheBytes = int64_t{128} << 20;

}  // namespace

absl::StatusOr<PatchLattice> LoadAcceptedSurface(BlobStore& blobs, const AcceptedSurface& surface) {
  MW_ASSIGN_OR_RETURN(const std::string bytes, blobs.Get(surface.digest));
  return DecodeSurface(bytes);
}

absl::StatusOr<JoinedMeshCounts> WriteAcceptedMesh(const std::vector<AcceptedSurface>& surfaces, BlobStore& blobs,
                                                   const JoinOptions& options, const Eigen::Vector3d& offset,
                                                   const std::string& path, ThreadPool& pool,
                                                   const JoinListener& listener) {
  SurfaceCache cache(
      [&](const std::string& digest) -> absl::StatusOr<SparseSurface> {
        MW_ASSIGN_OR_RETURN(const std::string bytes, blobs.Get(digest));
        return DecodeSparseSurface(bytes);
      },
      kCacheBytes);
  const auto load = [&](int64_t i) { return cache.Get(surfaces[static_cast<size_t>(i)].digest); };
  return WriteJoinedMesh(static_cast<int64_t>(surfaces.size()), load, options, offset, path, pool, listener);
}

}  // namespace meshwright
