// SPDX-License-Identifier: Apache-2.0
#include "coordinator/incidence/feasible_pairs.h"

#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include <absl/strings/str_cat.h>

#include "common/base/out_of_range.h"
#include "common/base/status_macros.h"
#include "coordinator/incidence/pair_rows.h"

namespace meshwright {
namespace {

PairLimits Limits(const FeasiblePairOptions& options) {
  constexpr double kRadians = std::numbers::pi / 180;
  return {.cos_min_angle = std::cos(options.min_angle_deg * kRadians),
          .cos_max_angle = std::cos(options.max_angle_deg * kRadians),
          .min_scale_ratio = options.min_scale_ratio};
}

void Collect(const std::vector<PairRow>& rows, FeasiblePairs& pairs) {
  pairs.matrix = IncidenceMatrix(static_cast<int>(rows.size()));
  for (size_t row = 0; row < rows.size(); ++row) {
    for (const CameraIndex other : rows[row].feasible) pairs.matrix.Set(static_cast<CameraIndex>(row), other);
    AddCounts(rows[row].counts, pairs.counts);
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

void CountOutcome(PairOutcome outcome, FeasiblePairCounts& counts) {
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
    case PairOutcome::kOutsideDepths:
      ++counts.outside_depths;
      break;
  }
}

void AddCounts(const FeasiblePairCounts& row, FeasiblePairCounts& sum) {
  sum.feasible += row.feasible;
  sum.few_points += row.few_points;
  sum.parallel_axes += row.parallel_axes;
  sum.behind_camera += row.behind_camera;
  sum.outside_image += row.outside_image;
  sum.angle_too_small += row.angle_too_small;
  sum.angle_too_large += row.angle_too_large;
  sum.scale_differs += row.scale_differs;
  sum.outside_depths += row.outside_depths;
  sum.by_common_view += row.by_common_view;
}

absl::Status FeasiblePairOptions::Validate() const {
  if (min_common_points < 1) {
    return OutOfRange("min_common_points", min_common_points, ">= 1");
  }
  if (!(min_angle_deg >= 0 && min_angle_deg <= max_angle_deg && max_angle_deg <= 180)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "min_angle_deg = ", min_angle_deg, ", max_angle_deg = ", max_angle_deg, ", expected 0 <= min <= max <= 180"));
  }
  if (!(min_scale_ratio >= 0 && min_scale_ratio <= 1)) {
    return OutOfRange("min_scale_ratio", min_scale_ratio, "0..1");
  }
  if (!(min_common_view > 0 && min_common_view <= 1)) {
    return OutOfRange("min_common_view", min_common_view, "0..1");
  }
  return absl::OkStatus();
}

absl::StatusOr<FeasiblePairs> FindFeasiblePairs(const std::vector<Camera>& cameras,
                                                const std::vector<SparsePoint>& points,
                                                const FeasiblePairOptions& options, ThreadPool& pool) {
  MW_RETURN_IF_ERROR(options.Validate());
  const std::vector<CameraGeometry> geometries = CameraGeometries(cameras);
  const PairLimits limits = Limits(options);
  FeasiblePairs pairs;
  if (!points.empty()) {
    pairs.source = FeasibilitySource::kSparsePoints;
    Collect(PairsFromPoints(geometries, points, limits, options.min_common_points, pool), pairs);
    pairs.probes = ProbesFromPoints(geometries, points, options.min_common_points);
  } else {
    pairs.source = FeasibilitySource::kOpticalAxes;
    pairs.probes = ProbesFromDepths(geometries, DepthsFromAxes(geometries, limits, pool));
    Collect(PairsWithoutPoints(geometries, pairs.probes, limits, options.min_common_view, pool), pairs);
  }
  if (pairs.matrix.CountBits() == 0) {
    return absl::FailedPreconditionError(NoPairMessage(cameras.size(), pairs, options));
  }
  for (CameraIndex i = 0; i < pairs.matrix.cameras(); ++i)
    pairs.counts.cameras_without_pair += pairs.matrix.RowSum(i) == 0 ? 1 : 0;
  return pairs;
}

}  // namespace meshwright
