// SPDX-License-Identifier: Apache-2.0
#include "coordinator/acceptance/support_index.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace meshwright {
namespace {

struct Range {
  double low = 0;
  double high = 0;
};

// The depth test in floats only sorts out; IsNear decides.
constexpr float kDepthSlack = 1e-6F;
// A plane that the direction meets at a flatter angle says little about the distance.
constexpr double kMinCosine = 0.15;
// Of the bilinear weights of four rays, so much must have a patch.
constexpr double kMinWeight = 0.5;

// Exact bounds of x / z over the ball around (x, z) with z > radius: the two tangents from the camera.
Range TangentRange(double x, double z, double radius) {
  const double denominator = z * z - radius * radius;
  const double reach = radius * std::sqrt(x * x + denominator);
  return {(x * z - reach) / denominator, (x * z + reach) / denominator};
}

// Whether there are four nodes around a point in lattice coordinates.
bool HasFourAround(const Lattice& lattice, const Eigen::Vector2d& at) {
  return at.x() >= 0 && at.y() >= 0 && at.x() < lattice.columns - 1 && at.y() < lattice.rows - 1;
}

}  // namespace

SupportIndex::SupportIndex(const SparseSurface& surface) : surface_(surface), finder_(surface) {
  const Lattice& lattice = surface.lattice;
  const Camera& camera = surface.camera;
  for (int column = 0; column < lattice.columns; ++column) {
    ray_x_.push_back(camera.RayInCam(lattice.PixelX(column) + 0.5, 0).x());
  }
  for (int row = 0; row < lattice.rows; ++row) ray_y_.push_back(camera.RayInCam(0, lattice.PixelY(row) + 0.5).y());
}

bool SupportIndex::SeesThrough(const Eigen::Vector3d& x_in_cam, double clearance) const {
  if (x_in_cam.z() <= clearance) return false;
  const Lattice& lattice = surface_.lattice;
  const Eigen::Vector2d at = lattice.FromPixel(surface_.camera.ProjectFromCam(x_in_cam));
  if (!HasFourAround(lattice, at)) return false;
  const int64_t node = lattice.Index(static_cast<int>(at.x()), static_cast<int>(at.y()));
  for (const int64_t corner : {node, node + 1, node + lattice.columns, node + lattice.columns + 1}) {
    const int32_t patch = finder_.At(corner);
    if (patch == PatchFinder::kNone || surface_.IsInferred(static_cast<size_t>(patch))) return false;
    if (surface_.depth[static_cast<size_t>(patch)] < x_in_cam.z() + clearance) return false;
  }
  return true;
}

bool SupportIndex::HasPatchNear(const Eigen::Vector3d& x_in_cam, double radius, bool is_inferred) const {
  if (x_in_cam.z() <= radius) return false;  // a ball that holds the camera: its window would be the whole image
  const Camera& camera = surface_.camera;
  const Lattice& lattice = surface_.lattice;
  const Range tangent_x = TangentRange(x_in_cam.x(), x_in_cam.z(), radius);
  const Range tangent_y = TangentRange(x_in_cam.y(), x_in_cam.z(), radius);
  const Eigen::Vector2d low =
      lattice.FromPixel({camera.fx * tangent_x.low + camera.cx, camera.fy * tangent_y.low + camera.cy});
  const Eigen::Vector2d high =
      lattice.FromPixel({camera.fx * tangent_x.high + camera.cx, camera.fy * tangent_y.high + camera.cy});
  if (high.x() < 0 || high.y() < 0 || low.x() > lattice.columns - 1 || low.y() > lattice.rows - 1) return false;
  const int first_column = static_cast<int>(std::ceil(std::max(low.x(), 0.0)));
  const int first_row = static_cast<int>(std::ceil(std::max(low.y(), 0.0)));
  const int last_column = static_cast<int>(std::min<double>(high.x(), lattice.columns - 1));
  const int last_row = static_cast<int>(std::min<double>(high.y(), lattice.rows - 1));
  if (first_column > last_column || first_row > last_row) return false;

  const double squared_radius = radius * radius;
  // Where surfaces agree, the node in the middle of the window says so at once.
  const int32_t middle = finder_.At(lattice.Index((first_column + last_column) / 2, (first_row + last_row) / 2));
  if (middle != PatchFinder::kNone && IsNear(middle, x_in_cam, squared_radius, is_inferred)) return true;
  const auto low_depth = static_cast<float>(x_in_cam.z() - radius) * (1 - kDepthSlack);
  const auto high_depth = static_cast<float>(x_in_cam.z() + radius) * (1 + kDepthSlack);
  for (int row = first_row; row <= last_row; ++row) {
    const int32_t end = finder_.FirstFrom(lattice.Index(last_column, row) + 1);
    for (int32_t patch = finder_.FirstFrom(lattice.Index(first_column, row)); patch < end; ++patch) {
      const float depth = surface_.depth[static_cast<size_t>(patch)];
      if (depth < low_depth || depth > high_depth) continue;
      if (IsNear(patch, x_in_cam, squared_radius, is_inferred)) return true;
    }
  }
  return false;
}

std::optional<double> SupportIndex::DistanceAlong(const Eigen::Vector3d& x_in_cam,
                                                  const Eigen::Vector3d& direction_in_cam, double max_distance) const {
  if (x_in_cam.z() <= max_distance) return std::nullopt;
  const Lattice& lattice = surface_.lattice;
  const Eigen::Vector2d at = lattice.FromPixel(surface_.camera.ProjectFromCam(x_in_cam));
  if (!HasFourAround(lattice, at)) return std::nullopt;
  const int column = static_cast<int>(at.x());
  const int row = static_cast<int>(at.y());
  const Eigen::Vector2d right_below = at - Eigen::Vector2d(column, row);
  double sum = 0;
  double weights = 0;
  for (const auto& [dx, dy] : {std::pair(0, 0), std::pair(1, 0), std::pair(0, 1), std::pair(1, 1)}) {
    const int32_t patch = finder_.At(lattice.Index(column + dx, row + dy));
    if (patch == PatchFinder::kNone || surface_.IsInferred(static_cast<size_t>(patch))) continue;
    const Eigen::Vector3d normal =
        surface_.camera.cam_from_world.rotation * surface_.normal_in_world[static_cast<size_t>(patch)].cast<double>();
    const double along = normal.dot(direction_in_cam);
    if (std::abs(along) < kMinCosine * direction_in_cam.norm()) continue;
    const double distance = normal.dot(PointInCam(patch) - x_in_cam) / along;
    if (std::abs(distance) > max_distance) continue;
    const double weight =
        (dx == 1 ? right_below.x() : 1 - right_below.x()) * (dy == 1 ? right_below.y() : 1 - right_below.y());
    sum += weight * distance;
    weights += weight;
  }
  if (weights < kMinWeight) return std::nullopt;
  return sum / weights;
}

Eigen::Vector3d SupportIndex::PointInCam(int32_t patch) const {
  const auto at = static_cast<size_t>(patch);
  const double z = surface_.depth[at];
  return {z * ray_x_[static_cast<size_t>(surface_.Column(at))], z * ray_y_[static_cast<size_t>(surface_.Row(at))], z};
}

bool SupportIndex::IsNear(int32_t patch, const Eigen::Vector3d& x_in_cam, double squared_radius,
                          bool is_inferred) const {
  if (surface_.IsInferred(static_cast<size_t>(patch)) && !is_inferred) return false;
  return (PointInCam(patch) - x_in_cam).squaredNorm() <= squared_radius;
}

}  // namespace meshwright
