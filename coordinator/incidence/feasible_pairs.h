// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/base/thread_pool.h"
#include "common/geometry/camera.h"
#include "common/scene/scene.h"
#include "coordinator/incidence/camera_probes.h"
#include "coordinator/incidence/incidence_matrix.h"

namespace meshwright {

// Which cameras form a feasible pair: section 3.2 of Jancosek et al. 2009.
struct FeasiblePairOptions {
  int min_common_points = 10;    // sparse points, >= 1 (section 3.2)
  double min_angle_deg = 2;      // apical angle, degrees, 0..max_angle_deg (section 3.2: 5)
  double max_angle_deg = 50;     // apical angle, degrees, min_angle_deg..180 (section 3.2)
  double min_scale_ratio = 0.8;  // smaller by larger size of a small ball at the point, 0..1 (section 3.2)
  // Without sparse points: share of one camera's probes (camera_probes.h) that the other must see within the limits,
  // 0..1.
  double min_common_view = 0.25;

  absl::Status Validate() const;
};

enum class FeasibilitySource { kSparsePoints, kOpticalAxes };

// Pairs by the first test that they failed. In the sum they are all N (N - 1) / 2 pairs.
struct FeasiblePairCounts {
  int64_t feasible = 0;
  int64_t few_points = 0;
  int64_t parallel_axes = 0;
  int64_t behind_camera = 0;
  int64_t outside_image = 0;
  int64_t angle_too_small = 0;
  int64_t angle_too_large = 0;
  int64_t scale_differs = 0;
  int64_t outside_depths = 0;
  int64_t by_common_view = 0;        // of the feasible ones: failed the axes' test, see a common part of space
  int64_t cameras_without_pair = 0;  // cameras that will never be processed
};

struct FeasiblePairs {
  IncidenceMatrix matrix;
  std::vector<CameraProbes> probes;  // what each camera presumably sees; for overlap and targets
  FeasibilitySource source = FeasibilitySource::kSparsePoints;
  FeasiblePairCounts counts;
};

// With sparse points, the paper asks for 10 common ones. "There are points in space whose projections do not change
// scale": here at least min_common_points common points must each have an apical angle and a scale ratio within the
// limits. So the definition is the same in both ways, near and far surface in one photograph cannot spoil a median, and
// two photographs from one spot, however many points they share, are not feasible. Only pairs that share a point are
// ever looked at.
//
// Without sparse points, the test is done on the shortest transversal of the two optical axes, which costs some ten
// nanoseconds for each pair of cameras whose frusta come near each other and a few for the others. Two things are added
// to the paper's test:
// - Axes that are nearly parallel meet anywhere. So a camera's typical depth is taken from its nearest pairs, and a
// pair
//   counts only if its axes meet between a third and three times that depth for both cameras. Without it, a street of
//   photographs taken sideways would pair each with those a kilometre further, whose axes it meets at the horizon.
// - Neighbours in a walk along a facade or through a room look in parallel: their axes meet nowhere, or outside the
//   images, although they see the same walls. So a pair is feasible too when either camera sees min_common_view of the
//   other's probes (points on a grid of its rays around its typical depth, or around that of the cameras nearest to it
//   if it has none; camera_probes.h) within the limits.
// Cameras that all look in parallel have no transversals and no depths: they need sparse points.
//
// FailedPrecondition when no pair is feasible: the message counts the failed tests and names the option to change.
absl::StatusOr<FeasiblePairs> FindFeasiblePairs(const std::vector<Camera>& cameras,
                                                const std::vector<SparsePoint>& points,
                                                const FeasiblePairOptions& options, ThreadPool& pool);

}  // namespace meshwright
