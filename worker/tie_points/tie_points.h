// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Core>

#include "common/base/thread_pool.h"
#include "common/surface/lattice.h"
#include "worker/photo_consistency/patch_scorer.h"
#include "worker/seeding/seeding.h"

namespace meshwright {

// Where one point of the scene is in the reference and in targets, measured in the photographs: what cameras have to
// agree with, instead of what they say.
struct TiePoint {
  struct Sight {
    int target = 0;
    Eigen::Vector2f pixel = Eigen::Vector2f::Zero();  // px of the target
  };
  Eigen::Vector2f pixel = Eigen::Vector2f::Zero();  // px of the reference
  std::vector<Sight> sights;                        // by target, at least one
};

// In every direction from where the cameras say that a seed is, px of the targets.
constexpr int kTieReachPx = 4;

// Seeds, looked for in the targets that see them: where photo-consistency has its peak around the image of the seed's
// plane, to a fraction of a pixel. Left out are seeds without a peak, and those whose peak is flat in some direction,
// as along an edge. At most one for each of `cells` x `cells` cells of the reference, that of the most targets and then
// the best seed. The same whatever the number of threads.
std::vector<TiePoint> MeasureTiePoints(const PatchScorer& scorer, const Lattice& lattice,
                                       const std::vector<Seed>& seeds, int cells, ThreadPool& pool);

}  // namespace meshwright
