// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdint>

#include "common/base/check.h"
#include "coordinator/incidence/pair_rows.h"

namespace meshwright {
namespace {

constexpr int64_t kCamerasPerPiece = 16;

// Common points of one pair of cameras by what TestPoint says of them.
struct CommonPoints {
  int feasible = 0;
  int angle_too_small = 0;
  int angle_too_large = 0;
  int scale_differs = 0;

  int all() const { return feasible + angle_too_small + angle_too_large + scale_differs; }

  void Add(PairOutcome outcome) {
    switch (outcome) {
      case PairOutcome::kFeasible:
        ++feasible;
        break;
      case PairOutcome::kAngleTooSmall:
        ++angle_too_small;
        break;
      case PairOutcome::kAngleTooLarge:
        ++angle_too_large;
        break;
      default:
        ++scale_differs;
        break;
    }
  }

  PairOutcome Judge(int min_common_points) const {
    if (all() < min_common_points) return PairOutcome::kFewPoints;
    if (feasible >= min_common_points) return PairOutcome::kFeasible;
    const int most = std::max({angle_too_small, angle_too_large, scale_differs});
    if (most == angle_too_small) return PairOutcome::kAngleTooSmall;
    return most == angle_too_large ? PairOutcome::kAngleTooLarge : PairOutcome::kScaleDiffers;
  }
};

// `common` has one element for each camera, all zero before and after.
PairRow RowFromPoints(size_t row, const std::vector<CameraGeometry>& cameras, const std::vector<SparsePoint>& points,
                      const std::vector<int32_t>& seen, const PairLimits& limits, int min_common_points,
                      std::vector<CommonPoints>& common) {
  const CameraGeometry& a = cameras[row];
  std::vector<CameraIndex> touched;
  for (const int32_t p : seen) {
    const SparsePoint& point = points[static_cast<size_t>(p)];
    if (a.Depth(point.x_in_world) <= 0) continue;
    auto other = std::upper_bound(point.seen_by.begin(), point.seen_by.end(), static_cast<CameraIndex>(row));
    for (; other != point.seen_by.end(); ++other) {
      const CameraGeometry& b = cameras[static_cast<size_t>(*other)];
      if (b.Depth(point.x_in_world) <= 0) continue;
      CommonPoints& with_other = common[static_cast<size_t>(*other)];
      if (with_other.all() == 0) touched.push_back(*other);
      with_other.Add(TestPoint(a, b, point.x_in_world, limits));
    }
  }
  PairRow result;
  result.counts.few_points = static_cast<int64_t>(cameras.size() - row - 1 - touched.size());
  std::sort(touched.begin(), touched.end());
  for (const CameraIndex other : touched) {
    const PairOutcome outcome = common[static_cast<size_t>(other)].Judge(min_common_points);
    CountOutcome(outcome, result.counts);
    if (outcome == PairOutcome::kFeasible) result.feasible.push_back(other);
    common[static_cast<size_t>(other)] = CommonPoints();
  }
  return result;
}

}  // namespace

std::vector<PairRow> PairsFromPoints(const std::vector<CameraGeometry>& cameras, const std::vector<SparsePoint>& points,
                                     const PairLimits& limits, int min_common_points, ThreadPool& pool) {
  const auto count = static_cast<int64_t>(cameras.size());
  std::vector<std::vector<int32_t>> seen(cameras.size());
  for (size_t p = 0; p < points.size(); ++p) {
    for (const CameraIndex camera : points[p].seen_by) {
      MW_CHECK(camera >= 0 && camera < count);
      seen[static_cast<size_t>(camera)].push_back(static_cast<int32_t>(p));
    }
  }
  std::vector<PairRow> rows(cameras.size());
  pool.ParallelFor(count, kCamerasPerPiece, [&](int64_t begin, int64_t end) {
    std::vector<CommonPoints> common(cameras.size());
    for (auto row = static_cast<size_t>(begin); row < static_cast<size_t>(end); ++row) {
      rows[row] = RowFromPoints(row, cameras, points, seen[row], limits, min_common_points, common);
    }
  });
  return rows;
}

}  // namespace meshwright
