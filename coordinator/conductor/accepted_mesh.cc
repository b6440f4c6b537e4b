#include "coordinator/conductor/accepted_mesh.h"

#include "common/base/status_macros.h"
#include "common/surface/codec.h"

namespace meshwright {

absl::StatusOr<PatchLattice> LoadAcceptedSurface(BlobStore& blobs, const AcceptedSurface& surface) {
  MW_ASSIGN_OR_RETURN(const std::string bytes, blobs.Get(surface.digest));
  return DecodeSurface(bytes);
}

absl::StatusOr<JoinedMeshCounts> WriteAcceptedMesh(const std::vector<AcceptedSurface>& surfaces, BlobStore& blobs,
                                                   const JoinOptions& options, const std::string& path,
                                                   ThreadPool& pool, const std::function<void()>& loading) {
  const auto load = [&](int64_t i) {
    if (loading) loading();
    return LoadAcceptedSurface(blobs, surfaces[static_cast<size_t>(i)]);
  };
  return WriteJoinedMesh(static_cast<int64_t>(surfaces.size()), load, options, path, pool);
}

}  // namespace meshwright
