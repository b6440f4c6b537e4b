#include "coordinator/incidence/feasible_pairs.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include <absl/strings/str_cat.h>

#include "common/base/check.h"
#include "common/base/status_macros.h"

namespace meshwright {
namespace {

constexpr int64_t kCamerasPerPiece = 16;

// What was found for one camera and all cameras after it.
struct RowResult {
  std::vector<CameraIndex> feasible;               // ascending
  std::vector<Eigen::Vector3d> midpoint_in_world;  // parallel to feasible; transversals only
  FeasiblePairCounts counts;
};

void Count(PairOutcome outcome, FeasiblePairCounts& counts) {
  switch (outcome) {
    case PairOutcome::kFeasible:
      ++counts.feasible;
      break;
    case PairOutcome::kFewPoints:
      ++counts.few_points;
      break;
    case PairOutcome::kParallelAxes:
      ++counts.parallel_axes;
      break;
    case PairOutcome::kBehindCamera:
      ++counts.behind_camera;
      break;
    case PairOutcome::kOutsideImage:
      ++counts.outside_image;
      break;
    case PairOutcome::kAngleTooSmall:
      ++counts.angle_too_small;
      break;
    case PairOutcome::kAngleTooLarge:
      ++counts.angle_too_large;
      break;
    case PairOutcome::kScaleDiffers:
      ++counts.scale_differs;
      break;
  }
}

PairLimits Limits(const FeasiblePairOptions& options) {
  constexpr double kRadians = std::numbers::pi / 180;
  return {.cos_min_angle = std::cos(options.min_angle_deg * kRadians),
          .cos_max_angle = std::cos(options.max_angle_deg * kRadians),
          .min_scale_ratio = options.min_scale_ratio};
}

// Common points of one pair of cameras by what TestPoint says of them.
struct CommonPoints {
  int feasible = 0;
  int angle_too_small = 0;
  int angle_too_large = 0;
  int scale_differs = 0;
  int all() const { return feasible + angle_too_small + angle_too_large + scale_differs; }
};

PairOutcome Judge(const CommonPoints& common, int min_common_points) {
  if (common.all() < min_common_points) return PairOutcome::kFewPoints;
  if (common.feasible >= min_common_points) return PairOutcome::kFeasible;
  const int worst = std::max({common.angle_too_small, common.angle_too_large, common.scale_differs});
  if (worst == common.angle_too_small) return PairOutcome::kAngleTooSmall;
  return worst == common.angle_too_large ? PairOutcome::kAngleTooLarge : PairOutcome::kScaleDiffers;
}

RowResult PairsFromPoints(size_t row, const std::vector<CameraGeometry>& cameras,
                          const std::vector<SparsePoint>& points, const std::vector<int32_t>& seen,
                          const FeasiblePairOptions& options, std::vector<CommonPoints>& scratch) {
  const PairLimits limits = Limits(options);
  const CameraGeometry& a = cameras[row];
  std::vector<CameraIndex> touched;
  for (const int32_t p : seen) {
    const SparsePoint& point = points[static_cast<size_t>(p)];
    if (a.Depth(point.x_in_world) <= 0) continue;
    auto other = std::upper_bound(point.seen_by.begin(), point.seen_by.end(), static_cast<CameraIndex>(row));
    for (; other != point.seen_by.end(); ++other) {
      const CameraGeometry& b = cameras[static_cast<size_t>(*other)];
      if (b.Depth(point.x_in_world) <= 0) continue;
      CommonPoints& common = scratch[static_cast<size_t>(*other)];
      if (common.all() == 0) touched.push_back(*other);
      switch (TestPoint(a, b, point.x_in_world, limits)) {
        case PairOutcome::kFeasible:
          ++common.feasible;
          break;
        case PairOutcome::kAngleTooSmall:
          ++common.angle_too_small;
          break;
        case PairOutcome::kAngleTooLarge:
          ++common.angle_too_large;
          break;
        default:
          ++common.scale_differs;
          break;
      }
    }
  }
  RowResult result;
  result.counts.few_points = static_cast<int64_t>(cameras.size() - row - 1 - touched.size());
  std::sort(touched.begin(), touched.end());
  for (const CameraIndex other : touched) {
    CommonPoints& common = scratch[static_cast<size_t>(other)];
    const PairOutcome outcome = Judge(common, options.min_common_points);
    Count(outcome, result.counts);
    if (outcome == PairOutcome::kFeasible) result.feasible.push_back(other);
    common = CommonPoints();
  }
  return result;
}

RowResult PairsFromAxes(size_t row, const std::vector<CameraGeometry>& cameras, const PairLimits& limits) {
  RowResult result;
  for (size_t other = row + 1; other < cameras.size(); ++other) {
    Eigen::Vector3d midpoint;
    const PairOutcome outcome = TestTransversal(cameras[row], cameras[other], limits, midpoint);
    Count(outcome, result.counts);
    if (outcome != PairOutcome::kFeasible) continue;
    result.feasible.push_back(static_cast<CameraIndex>(other));
    result.midpoint_in_world.push_back(midpoint);
  }
  return result;
}

void Add(const FeasiblePairCounts& row, FeasiblePairCounts& sum) {
  sum.feasible += row.feasible;
  sum.few_points += row.few_points;
  sum.parallel_axes += row.parallel_axes;
  sum.behind_camera += row.behind_camera;
  sum.outside_image += row.outside_image;
  sum.angle_too_small += row.angle_too_small;
  sum.angle_too_large += row.angle_too_large;
  sum.scale_differs += row.scale_differs;
}

void Collect(const std::vector<RowResult>& rows, FeasiblePairs& pairs) {
  pairs.matrix = IncidenceMatrix(static_cast<int>(rows.size()));
  for (size_t row = 0; row < rows.size(); ++row) {
    for (const CameraIndex other : rows[row].feasible) pairs.matrix.Set(static_cast<CameraIndex>(row), other);
    Add(rows[row].counts, pairs.counts);
  }
}

// Median depth at which the axes of a camera's pairs meet; 0 for cameras without a pair.
std::vector<double> TypicalDepths(const std::vector<CameraGeometry>& cameras, const std::vector<RowResult>& rows) {
  std::vector<std::vector<double>> depths(cameras.size());
  for (size_t row = 0; row < rows.size(); ++row) {
    for (size_t pair = 0; pair < rows[row].feasible.size(); ++pair) {
      const Eigen::Vector3d& midpoint = rows[row].midpoint_in_world[pair];
      const auto other = static_cast<size_t>(rows[row].feasible[pair]);
      depths[row].push_back(cameras[row].Depth(midpoint));
      depths[other].push_back(cameras[other].Depth(midpoint));
    }
  }
  std::vector<double> typical(cameras.size(), 0);
  for (size_t i = 0; i < cameras.size(); ++i) {
    if (depths[i].empty()) continue;
    const auto middle = depths[i].begin() + static_cast<std::ptrdiff_t>(depths[i].size() / 2);
    std::nth_element(depths[i].begin(), middle, depths[i].end());
    typical[i] = *middle;
  }
  return typical;
}

double FeasibleShare(const CameraGeometry& a, const CameraProbes& probes_of_a, const CameraGeometry& b,
                     const CameraProbes& probes_of_b, const PairLimits& limits) {
  if (probes_of_a.in_world.empty()) return 0;
  int feasible = 0;
  for (const Eigen::Vector3d& probe : probes_of_a.in_world) {
    if (SeesWithinDepths(b, probes_of_b, probe) && TestPoint(a, b, probe, limits) == PairOutcome::kFeasible) ++feasible;
  }
  return static_cast<double>(feasible) / static_cast<double>(probes_of_a.in_world.size());
}

void AddPairsByFrustumOverlap(const std::vector<CameraGeometry>& cameras, const FeasiblePairOptions& options,
                              FeasiblePairs& pairs) {
  const PairLimits limits = Limits(options);
  std::vector<size_t> lonely;
  for (size_t i = 0; i < cameras.size(); ++i) {
    if (pairs.matrix.RowSum(static_cast<CameraIndex>(i)) < options.min_pairs_per_camera) lonely.push_back(i);
  }
  for (const size_t i : lonely) {
    for (size_t j = 0; j < cameras.size(); ++j) {
      if (i == j || pairs.matrix.Get(static_cast<CameraIndex>(i), static_cast<CameraIndex>(j))) continue;
      const double reach = pairs.probes[i].frustum_radius + pairs.probes[j].frustum_radius;
      const Eigen::Vector3d apart = pairs.probes[i].frustum_center_in_world - pairs.probes[j].frustum_center_in_world;
      if (apart.squaredNorm() > reach * reach) continue;
      if (FeasibleShare(cameras[i], pairs.probes[i], cameras[j], pairs.probes[j], limits) <
          options.min_frustum_overlap) {
        continue;
      }
      pairs.matrix.Set(static_cast<CameraIndex>(i), static_cast<CameraIndex>(j));
      ++pairs.counts.by_frustum_overlap;
    }
  }
}

std::string NoPairMessage(size_t cameras, const FeasiblePairs& pairs, const FeasiblePairOptions& options) {
  const FeasiblePairCounts& counts = pairs.counts;
  const std::string angles =
      absl::StrCat(counts.angle_too_small, " see it under less than min_angle_deg = ", options.min_angle_deg, ", ",
                   counts.angle_too_large, " under more than max_angle_deg = ", options.max_angle_deg, ", ",
                   counts.scale_differs, " differ in scale by more than min_scale_ratio = ", options.min_scale_ratio);
  const std::string head = absl::StrCat("no two of the ", cameras, " cameras form a feasible pair: ");
  if (pairs.source == FeasibilitySource::kSparsePoints) {
    return absl::StrCat(
        head, "by their sparse points, ", counts.few_points,
        " pairs share fewer than min_common_points = ", options.min_common_points, ", ", angles,
        "; expected overlapping photographs with a baseline, else lower min_common_points or widen the limits");
  }
  return absl::StrCat(
      head, "there are no sparse points, and of the transversals of the optical axes ", counts.parallel_axes,
      " belong to parallel axes, ", counts.behind_camera, " lie behind a camera, ", counts.outside_image,
      " outside an image, ", angles,
      "; give a scene with sparse points (cameras that look in parallel need them) or widen the limits");
}

}  // namespace

absl::Status FeasiblePairOptions::Validate() const {
  if (min_common_points < 1) {
    return absl::InvalidArgumentError(absl::StrCat("min_common_points = ", min_common_points, ", expected >= 1"));
  }
  if (!(min_angle_deg >= 0 && min_angle_deg <= max_angle_deg && max_angle_deg <= 180)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "min_angle_deg = ", min_angle_deg, ", max_angle_deg = ", max_angle_deg, ", expected 0 <= min <= max <= 180"));
  }
  if (!(min_scale_ratio >= 0 && min_scale_ratio <= 1)) {
    return absl::InvalidArgumentError(absl::StrCat("min_scale_ratio = ", min_scale_ratio, ", expected 0..1"));
  }
  if (min_pairs_per_camera < 0) {
    return absl::InvalidArgumentError(absl::StrCat("min_pairs_per_camera = ", min_pairs_per_camera, ", expected >= 0"));
  }
  if (!(min_frustum_overlap > 0 && min_frustum_overlap <= 1)) {
    return absl::InvalidArgumentError(absl::StrCat("min_frustum_overlap = ", min_frustum_overlap, ", expected 0..1"));
  }
  return absl::OkStatus();
}

absl::StatusOr<FeasiblePairs> FindFeasiblePairs(const std::vector<Camera>& cameras,
                                                const std::vector<SparsePoint>& points,
                                                const FeasiblePairOptions& options, ThreadPool& pool) {
  MW_RETURN_IF_ERROR(options.Validate());
  const std::vector<CameraGeometry> geometries = CameraGeometries(cameras);
  const auto count = static_cast<int64_t>(cameras.size());
  std::vector<RowResult> rows(cameras.size());
  FeasiblePairs pairs;
  if (!points.empty()) {
    std::vector<std::vector<int32_t>> seen(cameras.size());
    for (size_t p = 0; p < points.size(); ++p) {
      for (const CameraIndex camera : points[p].seen_by) {
        MW_CHECK(camera >= 0 && camera < count);
        seen[static_cast<size_t>(camera)].push_back(static_cast<int32_t>(p));
      }
    }
    pool.ParallelFor(count, kCamerasPerPiece, [&](int64_t begin, int64_t end) {
      std::vector<CommonPoints> scratch(cameras.size());
      for (int64_t i = begin; i < end; ++i) {
        const auto row = static_cast<size_t>(i);
        rows[row] = PairsFromPoints(row, geometries, points, seen[row], options, scratch);
      }
    });
    pairs.source = FeasibilitySource::kSparsePoints;
    Collect(rows, pairs);
    pairs.probes = ProbesFromPoints(geometries, points, options.min_common_points);
  } else {
    const PairLimits limits = Limits(options);
    pool.ParallelFor(count, kCamerasPerPiece, [&](int64_t begin, int64_t end) {
      for (int64_t i = begin; i < end; ++i) {
        rows[static_cast<size_t>(i)] = PairsFromAxes(static_cast<size_t>(i), geometries, limits);
      }
    });
    pairs.source = FeasibilitySource::kOpticalAxes;
    Collect(rows, pairs);
    pairs.probes = ProbesFromDepths(geometries, TypicalDepths(geometries, rows));
    AddPairsByFrustumOverlap(geometries, options, pairs);
  }
  if (pairs.matrix.CountBits() == 0) {
    return absl::FailedPreconditionError(NoPairMessage(cameras.size(), pairs, options));
  }
  for (CameraIndex i = 0; i < count; ++i) pairs.counts.cameras_without_pair += pairs.matrix.RowSum(i) == 0 ? 1 : 0;
  return pairs;
}

}  // namespace meshwright
