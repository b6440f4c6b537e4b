// SPDX-License-Identifier: Apache-2.0
#include "coordinator/incidence/overlap_graph.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/base/out_of_range.h"
#include "coordinator/incidence/ball_grid.h"

namespace meshwright {
namespace {

constexpr int64_t kCamerasPerPiece = 16;

// Whether `b` sees enough of the probes of `a` from not too different a side.
bool SeesProbes(const CameraGeometry& a, const CameraProbes& probes_of_a, const CameraGeometry& b,
                const CameraProbes& probes_of_b, double min_share, double cos_max_angle) {
  const double needed = std::max(1.0, min_share * static_cast<double>(probes_of_a.in_world.size()));
  int seen = 0;
  for (const Eigen::Vector3d& probe : probes_of_a.in_world) {
    if (!SeesWithinDepths(b, probes_of_b, probe)) continue;
    if (CosApicalAngle(a, b, probe) < cos_max_angle) continue;
    if (++seen >= needed) return true;
  }
  return false;
}

}  // namespace

absl::Status OverlapOptions::Validate() const {
  if (!(min_share >= 0 && min_share <= 1)) return OutOfRange("min_share", min_share, "0..1");
  if (!(max_angle_deg >= 0 && max_angle_deg <= 180)) return OutOfRange("max_angle_deg", max_angle_deg, "0..180");
  return absl::OkStatus();
}

bool OverlapGraph::Overlap(CameraIndex i, CameraIndex j) const {
  return std::binary_search(Of(i).begin(), Of(i).end(), j);
}

OverlapGraph FindOverlaps(const std::vector<CameraGeometry>& cameras, const std::vector<CameraProbes>& probes,
                          const IncidenceMatrix& feasible, const OverlapOptions& options, ThreadPool& pool) {
  const double cos_max_angle = std::cos(options.max_angle_deg * std::numbers::pi / 180);
  const BallGrid near(probes);
  std::vector<std::vector<CameraIndex>> found(cameras.size());  // each pair in one of its two rows, or in both
  pool.ParallelFor(static_cast<int64_t>(cameras.size()), kCamerasPerPiece, [&](int64_t begin, int64_t end) {
    std::vector<CameraIndex> meeting;
    for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
      near.FindMeeting(static_cast<CameraIndex>(i), meeting);
      for (const CameraIndex other : meeting) {
        const auto j = static_cast<size_t>(other);
        if (SeesProbes(cameras[i], probes[i], cameras[j], probes[j], options.min_share, cos_max_angle) ||
            SeesProbes(cameras[j], probes[j], cameras[i], probes[i], options.min_share, cos_max_angle)) {
          found[i].push_back(other);
        }
      }
      const std::vector<CameraIndex>& paired = feasible.Neighbours(static_cast<CameraIndex>(i));
      found[i].insert(found[i].end(), paired.begin(), paired.end());
    }
  });
  std::vector<std::vector<CameraIndex>> rows = found;
  for (size_t i = 0; i < cameras.size(); ++i) {
    for (const CameraIndex j : found[i]) rows[static_cast<size_t>(j)].push_back(static_cast<CameraIndex>(i));
  }
  for (std::vector<CameraIndex>& row : rows) {
    std::sort(row.begin(), row.end());
    row.erase(std::unique(row.begin(), row.end()), row.end());
  }
  return OverlapGraph(std::move(rows));
}

}  // namespace meshwright
