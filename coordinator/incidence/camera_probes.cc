// SPDX-License-Identifier: Apache-2.0
#include "coordinator/incidence/camera_probes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>

namespace meshwright {
namespace {

// A camera that only knows a typical depth is taken to see surface between these multiples of it.
constexpr double kNearOfTypical = 1.0 / 3;
constexpr double kFarOfTypical = 3;
constexpr std::array<double, 4> kProbeDepthsOfTypical = {0.65, 0.87, 1.15, 1.54};
constexpr int kRayColumns = 4;
constexpr int kRayRows = 3;
static_assert(kRayColumns * kRayRows * 4 == kMaxProbes);

// Sparse points thin out towards the borders of what is seen: bounds reach beyond their 5 and 95 percent.
constexpr double kNearOfPoints = 0.5;
constexpr double kFarOfPoints = 1.5;

constexpr size_t kDepthLenders = 5;

// Value below which a share of the values lies. `values` are reordered and must not be empty.
double Quantile(std::vector<double>& values, double share) {
  const auto rank = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + rank, values.end());
  return values[static_cast<size_t>(rank)];
}

void SetDepths(const CameraGeometry& geometry, double near_depth, double far_depth, CameraProbes& probes) {
  const Camera& camera = geometry.camera;
  probes.near_depth = near_depth;
  probes.far_depth = far_depth;
  probes.frustum_center_in_world = geometry.center_in_world + 0.5 * (near_depth + far_depth) * geometry.axis_in_world;
  probes.frustum_radius = 0;
  for (const double depth : {near_depth, far_depth}) {
    for (const double x : {0.0, static_cast<double>(camera.width)}) {
      for (const double y : {0.0, static_cast<double>(camera.height)}) {
        const double distance = (camera.BackProject(x, y, depth) - probes.frustum_center_in_world).norm();
        probes.frustum_radius = std::max(probes.frustum_radius, distance);
      }
    }
  }
}

CameraProbes ProbesAround(const CameraGeometry& geometry, double typical_depth) {
  CameraProbes probes;
  SetDepths(geometry, kNearOfTypical * typical_depth, kFarOfTypical * typical_depth, probes);
  const Camera& camera = geometry.camera;
  for (const double factor : kProbeDepthsOfTypical) {
    for (int row = 0; row < kRayRows; ++row) {
      for (int column = 0; column < kRayColumns; ++column) {
        probes.in_world.push_back(camera.BackProject((column + 0.5) * camera.width / kRayColumns,
                                                     (row + 0.5) * camera.height / kRayRows, factor * typical_depth));
      }
    }
  }
  return probes;
}

// The median of what the nearest cameras know, 0 when none knows.
double BorrowedDepth(const std::vector<CameraGeometry>& cameras, const std::vector<double>& typical_depths,
                     size_t borrower) {
  std::vector<std::pair<double, size_t>> lenders;  // squared distance, camera
  for (size_t i = 0; i < cameras.size(); ++i) {
    if (!(typical_depths[i] > 0)) continue;
    lenders.emplace_back((cameras[i].center_in_world - cameras[borrower].center_in_world).squaredNorm(), i);
  }
  if (lenders.empty()) return 0;
  const size_t count = std::min(kDepthLenders, lenders.size());
  std::partial_sort(lenders.begin(), lenders.begin() + static_cast<std::ptrdiff_t>(count), lenders.end());
  std::vector<double> depths;
  for (size_t i = 0; i < count; ++i) depths.push_back(typical_depths[lenders[i].second]);
  return Quantile(depths, 0.5);
}

}  // namespace

bool SeesWithinDepths(const CameraGeometry& camera, const CameraProbes& probes, const Eigen::Vector3d& x_in_world) {
  const Eigen::Vector3d x_in_cam = camera.camera.CamFromWorld(x_in_world);
  return x_in_cam.z() >= probes.near_depth && x_in_cam.z() <= probes.far_depth && x_in_cam.z() > 0 &&
         camera.camera.Contains(camera.camera.ProjectFromCam(x_in_cam));
}

std::vector<CameraProbes> ProbesFromPoints(const std::vector<CameraGeometry>& cameras,
                                           const std::vector<SparsePoint>& points, int min_points) {
  std::vector<std::vector<int32_t>> observed(cameras.size());
  for (size_t p = 0; p < points.size(); ++p) {
    for (const CameraIndex camera : points[p].seen_by) {
      if (cameras[static_cast<size_t>(camera)].Sees(points[p].x_in_world)) {
        observed[static_cast<size_t>(camera)].push_back(static_cast<int32_t>(p));
      }
    }
  }
  std::vector<CameraProbes> probes(cameras.size());
  std::vector<double> typical_depths(cameras.size(), 0);
  for (size_t i = 0; i < cameras.size(); ++i) {
    if (observed[i].empty() || static_cast<int>(observed[i].size()) < min_points) continue;
    const Camera& camera = cameras[i].camera;
    std::vector<double> depths;
    depths.reserve(observed[i].size());
    std::array<bool, kMaxProbes> taken = {};
    for (const int32_t p : observed[i]) {
      const Eigen::Vector3d& x_in_world = points[static_cast<size_t>(p)].x_in_world;
      const Eigen::Vector3d x_in_cam = camera.CamFromWorld(x_in_world);
      depths.push_back(x_in_cam.z());
      const Eigen::Vector2d pixel = camera.ProjectFromCam(x_in_cam);
      const int column = std::min(kProbeColumns - 1, static_cast<int>(pixel.x() * kProbeColumns / camera.width));
      const int row = std::min(kProbeRows - 1, static_cast<int>(pixel.y() * kProbeRows / camera.height));
      const int cell = row * kProbeColumns + column;
      bool& cell_taken = taken[static_cast<size_t>(cell)];
      if (cell_taken) continue;
      cell_taken = true;
      probes[i].in_world.push_back(x_in_world);
    }
    typical_depths[i] = Quantile(depths, 0.5);
    SetDepths(cameras[i], kNearOfPoints * Quantile(depths, 0.05), kFarOfPoints * Quantile(depths, 0.95), probes[i]);
  }
  for (size_t i = 0; i < cameras.size(); ++i) {
    if (!probes[i].in_world.empty()) continue;
    const double depth = BorrowedDepth(cameras, typical_depths, i);
    if (depth > 0) probes[i] = ProbesAround(cameras[i], depth);
  }
  return probes;
}

std::vector<CameraProbes> ProbesFromDepths(const std::vector<CameraGeometry>& cameras,
                                           const std::vector<double>& typical_depths) {
  std::vector<CameraProbes> probes(cameras.size());
  for (size_t i = 0; i < cameras.size(); ++i) {
    const double depth = typical_depths[i] > 0 ? typical_depths[i] : BorrowedDepth(cameras, typical_depths, i);
    if (depth > 0) probes[i] = ProbesAround(cameras[i], depth);
  }
  return probes;
}

}  // namespace meshwright
