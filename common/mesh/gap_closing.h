// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include <absl/status/statusor.h>

#include "common/base/thread_pool.h"
#include "common/mesh/border_stitching.h"
#include "common/mesh/join_progress.h"
#include "common/mesh/part_borders.h"

namespace meshwright {

// Triangles between border vertices, counter-clockwise seen from outside, that close gaps where no camera contradicts:
// they lie where the space that cameras look through ends (CutFreeSpace), at least two cameras vouch for each of them,
// and few rays pass through it (GapWitness, SurfaceWitness). `reach`: how large gaps may be, as a share of a
// photograph's longer side.
//
// `stitcher` knows which border vertices may take triangles. `is_small`, per component: it has been left out. Works in
// blocks of vertices, one a thread, with the surfaces that see a block loaded one after the other, and spools what
// grows with the mesh. Depends on the surfaces and their order alone. Errors: those of `load`.
absl::StatusOr<std::vector<BorderStitcher::Face>> FindGapTriangles(const PartBorders& borders,
                                                                   const BorderStitcher& stitcher,
                                                                   const std::vector<uint8_t>& is_small, double reach,
                                                                   const LoadSurface& load, ThreadPool& pool,
                                                                   JoinProgress& progress);

}  // namespace meshwright
