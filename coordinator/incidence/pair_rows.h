// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "common/base/ids.h"
#include "common/base/thread_pool.h"
#include "common/scene/scene.h"
#include "coordinator/incidence/camera_probes.h"
#include "coordinator/incidence/feasible_pairs.h"
#include "coordinator/incidence/pair_geometry.h"

// The two ways of section 3.2 to the rows of the incidence matrix; the inner parts of FindFeasiblePairs.
namespace meshwright {

// One camera against all cameras after it.
struct PairRow {
  std::vector<CameraIndex> feasible;  // ascending
  FeasiblePairCounts counts;          // one outcome for each camera after it
};

void CountOutcome(PairOutcome outcome, FeasiblePairCounts& counts);
void AddCounts(const FeasiblePairCounts& row, FeasiblePairCounts& sum);

// Only pairs that share a point are looked at: tracks are indexed by camera.
std::vector<PairRow> PairsFromPoints(const std::vector<CameraGeometry>& cameras, const std::vector<SparsePoint>& points,
                                     const PairLimits& limits, int min_common_points, ThreadPool& pool);

// For each camera the median depth at which its axis meets those of the nearest cameras (by their centres) that pass
// the test on the transversal; 0 when fewer than two do
// (none, in scenes where nobody has two).
std::vector<double> DepthsFromAxes(const std::vector<CameraGeometry>& cameras, const PairLimits& limits,
                                   ThreadPool& pool);

// The transversal's test, with its midpoint within the depths of both cameras' probes, or enough of either camera's
// probes in both images (see FindFeasiblePairs); by the transversal alone when no camera has probes.
std::vector<PairRow> PairsWithoutPoints(const std::vector<CameraGeometry>& cameras,
                                        const std::vector<CameraProbes>& probes, const PairLimits& limits,
                                        double min_common_view, ThreadPool& pool);

}  // namespace meshwright
