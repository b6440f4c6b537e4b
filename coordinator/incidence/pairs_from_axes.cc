// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdint>
#include <utility>

#include "coordinator/incidence/pair_rows.h"

namespace meshwright {
namespace {

constexpr int64_t kCamerasPerPiece = 16;
constexpr size_t kNearestPairs = 8;
// One crossing of two axes may be anywhere.
constexpr size_t kLeastPairs = 2;

// A pair by the distance of its centres; ties by the other camera's index.
struct NearPair {
  double squared_distance = 0;
  size_t other = 0;
  double depth = 0;  // of the transversal's midpoint
  friend bool operator<(const NearPair& a, const NearPair& b) {
    return std::pair(a.squared_distance, a.other) < std::pair(b.squared_distance, b.other);
  }
};

bool WithinDepths(const CameraGeometry& camera, const CameraProbes& probes, const Eigen::Vector3d& x_in_world) {
  const double depth = camera.Depth(x_in_world);
  return depth >= probes.near_depth && depth <= probes.far_depth;
}

PairOutcome TestAxes(const CameraGeometry& a, const CameraProbes& probes_of_a, const CameraGeometry& b,
                     const CameraProbes& probes_of_b, const PairLimits& limits, bool depths_known) {
  Eigen::Vector3d midpoint;
  const PairOutcome outcome = TestTransversal(a, b, limits, midpoint);
  if (outcome == PairOutcome::kFeasible && depths_known &&
      !(WithinDepths(a, probes_of_a, midpoint) && WithinDepths(b, probes_of_b, midpoint))) {
    return PairOutcome::kOutsideDepths;
  }
  return outcome;
}

// Whether `b` sees `min_share` of the probes of `a`, under a useful angle and at about the same scale.
bool HaveCommonView(const CameraGeometry& a, const CameraProbes& probes_of_a, const CameraGeometry& b,
                    const CameraProbes& probes_of_b, const PairLimits& limits, double min_share) {
  const double needed = min_share * static_cast<double>(probes_of_a.in_world.size());
  int common = 0;
  for (const Eigen::Vector3d& probe : probes_of_a.in_world) {
    if (!SeesWithinDepths(b, probes_of_b, probe) || TestPoint(a, b, probe, limits) != PairOutcome::kFeasible) continue;
    if (++common >= needed) return true;
  }
  return false;
}

}  // namespace

std::vector<double> DepthsFromAxes(const std::vector<CameraGeometry>& cameras, const PairLimits& limits,
                                   ThreadPool& pool) {
  std::vector<double> depths(cameras.size(), 0);
  std::vector<size_t> pairs(cameras.size(), 0);
  std::vector<Eigen::Vector3d> centers;  // apart from the rest, so that a pass over all stays in the cache
  centers.reserve(cameras.size());
  for (const CameraGeometry& camera : cameras) centers.push_back(camera.center_in_world);
  pool.ParallelFor(static_cast<int64_t>(cameras.size()), kCamerasPerPiece, [&](int64_t begin, int64_t end) {
    std::vector<NearPair> nearest;  // a heap, the farthest in front
    for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
      nearest.clear();
      for (size_t j = 0; j < cameras.size(); ++j) {
        if (i == j) continue;
        NearPair pair{(centers[i] - centers[j]).squaredNorm(), j};
        const bool full = nearest.size() == kNearestPairs;
        if (full && !(pair < nearest.front())) continue;
        Eigen::Vector3d midpoint;
        // In the order of their indices: the first two arguments' roles must not depend on who asks.
        if (TestTransversal(cameras[std::min(i, j)], cameras[std::max(i, j)], limits, midpoint) !=
            PairOutcome::kFeasible) {
          continue;
        }
        pair.depth = cameras[i].Depth(midpoint);
        if (full) {
          std::pop_heap(nearest.begin(), nearest.end());
          nearest.back() = pair;
        } else {
          nearest.push_back(pair);
        }
        std::push_heap(nearest.begin(), nearest.end());
      }
      pairs[i] = nearest.size();
      if (nearest.empty()) continue;
      std::sort(nearest.begin(), nearest.end(), [](const NearPair& a, const NearPair& b) { return a.depth < b.depth; });
      depths[i] = nearest[nearest.size() / 2].depth;
    }
  });
  // Unless nobody has more, as in a scene of two cameras.
  if (std::any_of(pairs.begin(), pairs.end(), [](size_t count) { return count >= kLeastPairs; })) {
    for (size_t i = 0; i < cameras.size(); ++i) depths[i] = pairs[i] >= kLeastPairs ? depths[i] : 0;
  }
  return depths;
}

std::vector<PairRow> PairsWithoutPoints(const std::vector<CameraGeometry>& cameras,
                                        const std::vector<CameraProbes>& probes, const PairLimits& limits,
                                        double min_common_view, ThreadPool& pool) {
  std::vector<PairRow> rows(cameras.size());
  // Borrowing gives all cameras probes or none.
  const bool depths_known = !probes.empty() && !probes.front().in_world.empty();
  pool.ParallelFor(static_cast<int64_t>(cameras.size()), kCamerasPerPiece, [&](int64_t begin, int64_t end) {
    for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
      for (size_t j = i + 1; j < cameras.size(); ++j) {
        PairOutcome outcome = PairOutcome::kOutsideDepths;
        if (!depths_known || FrustaMeet(probes[i], probes[j])) {
          outcome = TestAxes(cameras[i], probes[i], cameras[j], probes[j], limits, depths_known);
          if (outcome != PairOutcome::kFeasible && depths_known &&
              (HaveCommonView(cameras[i], probes[i], cameras[j], probes[j], limits, min_common_view) ||
               HaveCommonView(cameras[j], probes[j], cameras[i], probes[i], limits, min_common_view))) {
            outcome = PairOutcome::kFeasible;
            ++rows[i].counts.by_common_view;
          }
        }
        CountOutcome(outcome, rows[i].counts);
        if (outcome == PairOutcome::kFeasible) rows[i].feasible.push_back(static_cast<CameraIndex>(j));
      }
    }
  });
  return rows;
}

}  // namespace meshwright
