// SPDX-License-Identifier: Apache-2.0
#include "coordinator/forecast/surface_to_grow.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace meshwright {
namespace {

// Every second probe of a camera is enough for a share.
constexpr size_t kProbeStride = 2;
// Two cameras see the same side of a surface if their rays differ by less.
constexpr double kMaxAngleDeg = 60;
constexpr int64_t kCamerasPerPiece = 16;

const double kCosMaxAngle = std::cos(kMaxAngleDeg * std::numbers::pi / 180);

}  // namespace

SurfaceToGrow::SurfaceToGrow(const std::vector<CameraGeometry>& cameras, const std::vector<CameraProbes>& probes,
                             const OverlapGraph& overlaps, int k_a, ThreadPool& pool)
    : cameras_(cameras), probes_(probes), overlaps_(overlaps), needed_(k_a + 1) {
  first_point_.push_back(0);
  for (const CameraProbes& own : probes) {
    first_point_.push_back(first_point_.back() + (own.in_world.size() + kProbeStride - 1) / kProbeStride);
  }
  points_.resize(first_point_.back());
  pool.ParallelFor(static_cast<int64_t>(cameras.size()), kCamerasPerPiece, [&](int64_t begin, int64_t end) {
    for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
      for (size_t point = 0; point < PointsOf(i); ++point) {
        Point& own = points_[first_point_[i] + point];
        own.waiting = 1;
        for (const CameraIndex other : overlaps.Of(static_cast<CameraIndex>(i))) {
          const bool has_room = own.waiting < std::numeric_limits<uint16_t>::max();
          if (has_room && !overlaps.Of(other).empty() && Sees(other, i, point)) ++own.waiting;
        }
      }
    }
  });
}

bool SurfaceToGrow::Sees(CameraIndex camera, size_t owner, size_t point) const {
  const auto index = static_cast<size_t>(camera);
  const Eigen::Vector3d& x_in_world = probes_[owner].in_world[kProbeStride * point];
  return SeesWithinDepths(cameras_[index], probes_[index], x_in_world) &&
         CosApicalAngle(cameras_[index], cameras_[owner], x_in_world) >= kCosMaxAngle;
}

void SurfaceToGrow::Commit(CameraIndex camera, bool is_processed) {
  const auto note = [&](Point& point) {
    if (point.waiting > 0) --point.waiting;
    if (is_processed && point.grown_by < std::numeric_limits<uint16_t>::max()) ++point.grown_by;
  };
  for (const CameraIndex other : overlaps_.Of(camera)) {
    const auto owner = static_cast<size_t>(other);
    for (size_t point = 0; point < PointsOf(owner); ++point) {
      if (Sees(camera, owner, point)) note(points_[first_point_[owner] + point]);
    }
  }
  const auto index = static_cast<size_t>(camera);
  for (size_t point = 0; point < PointsOf(index); ++point) note(points_[first_point_[index] + point]);
}

template <typename Share>
double SurfaceToGrow::MeanOf(CameraIndex camera, const Share& share) const {
  const auto index = static_cast<size_t>(camera);
  if (PointsOf(index) == 0) return 1;
  double sum = 0;
  for (size_t point = 0; point < PointsOf(index); ++point) sum += share(points_[first_point_[index] + point]);
  return sum / static_cast<double>(PointsOf(index));
}

double SurfaceToGrow::ShareNow(CameraIndex camera) const {
  return MeanOf(camera, [&](const Point& point) { return int{point.grown_by} < needed_ ? 1.0 : 0.0; });
}

double SurfaceToGrow::ExpectedShare(CameraIndex camera) const {
  return MeanOf(camera, [&](const Point& point) {
    const double left = std::max(0, needed_ - int{point.grown_by});
    return std::min(1.0, left / std::max<double>(1, point.waiting));
  });
}

}  // namespace meshwright
