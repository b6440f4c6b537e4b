// SPDX-License-Identifier: Apache-2.0
#include "coordinator/conductor/final_surfaces.h"

#include <cstdint>
#include <memory>

#include "common/base/status_macros.h"
#include "common/surface/codec.h"
#include "common/surface/surface_cache.h"

namespace meshwright {
namespace {

// Decoded surfaces kept while others are judged by them: neighbours in the order of commits share most of them.
constexpr int64_t kCacheBytes = int64_t{64} << 20;
// Late patches in smaller pieces close no gap, and the join has to sew each of them on.
constexpr int64_t kMinLatePatches = 30;

absl::Status AddSurface(const PatchLattice& surface, const AcceptedSurface& origin, const PutSurface& put,
                        std::vector<AcceptedSurface>& surfaces) {
  const int64_t patches = surface.CountPatches();
  if (patches == 0) return absl::OkStatus();
  AcceptedSurface stored = {.sequence = origin.sequence, .camera = origin.camera, .patches = patches};
  MW_ASSIGN_OR_RETURN(stored.digest, put(EncodeSurface(surface)));
  surfaces.push_back(std::move(stored));
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<JudgedSurfaces> JudgeCommittedSurfaces(const std::vector<CommittedSurface>& committed,
                                                      const AcceptanceOptions& options, BlobStore& blobs,
                                                      const PutSurface& put, ThreadPool& pool,
                                                      const std::function<void(int judged)>& progress) {
  SurfaceCache cache(
      [&](const std::string& digest) -> absl::StatusOr<SparseSurface> {
        MW_ASSIGN_OR_RETURN(const std::string bytes, blobs.Get(digest));
        return DecodeSparseSurface(bytes);
      },
      kCacheBytes);
  JudgedSurfaces result;
  std::vector<AcceptedSurface> late;
  for (size_t i = 0; i < committed.size(); ++i) {
    const CommittedSurface& surface = committed[i];
    MW_ASSIGN_OR_RETURN(const std::shared_ptr<const SparseSurface> filtered, cache.Get(surface.filtered_digest));
    const PatchLattice lattice = filtered->ToLattice();
    PatchLattice accepted = PatchLattice::Empty(lattice.camera_index, lattice.camera, lattice.lattice.step);
    if (!surface.accepted.digest.empty()) {
      MW_ASSIGN_OR_RETURN(const std::string bytes, blobs.Get(surface.accepted.digest));
      MW_ASSIGN_OR_RETURN(accepted, DecodeSurface(bytes));
    }
    const auto load = [&](int k) { return cache.Get(surface.supporters[static_cast<size_t>(k)].digest); };
    MW_ASSIGN_OR_RETURN(FinalSurface judged, JudgeAgain(lattice, accepted, static_cast<int>(surface.supporters.size()),
                                                        load, options, pool));
    RemoveSmallComponents(kMinLatePatches, judged.late);
    MW_RETURN_IF_ERROR(AddSurface(judged.kept, surface.accepted, put, result.surfaces));
    MW_RETURN_IF_ERROR(AddSurface(judged.late, surface.accepted, put, late));
    result.cameras.push_back({.camera = surface.accepted.camera,
                              .kept = judged.kept.CountPatches() + judged.late.CountPatches(),
                              .inferred = judged.late.CountInferred(),
                              .contradicted = judged.contradicted,
                              .unsupported = judged.unsupported});
    progress(static_cast<int>(i) + 1);
  }
  result.surfaces.insert(result.surfaces.end(), late.begin(), late.end());
  return result;
}

}  // namespace meshwright
