// SPDX-License-Identifier: Apache-2.0
#include "common/closing/surface_witness.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "common/geometry/level_of_detail.h"

namespace meshwright {
namespace {

// A flatter triangle shows nothing; it may be the side of what hides a part of the scene.
constexpr double kMinCosine = 0.2;
// In so many of sixteen directions there must be surface. Roofs surround what is between them in ten or eleven.
constexpr int kMinDirections = 14;
// Surface nearer than so many d before or behind a triangle is on it.
constexpr double kClearance = 3;

std::vector<uint8_t> HasPatch(const SparseSurface& surface) {
  std::vector<uint8_t> has_patch(static_cast<size_t>(surface.lattice.nodes()), 0);
  for (const int32_t node : surface.node) has_patch[static_cast<size_t>(node)] = 1;
  return has_patch;
}

// Nothing when a corner does not lie before the camera.
std::optional<std::array<Eigen::Vector3d, 3>> InCam(const Camera& camera,
                                                    const std::array<Eigen::Vector3d, 3>& triangle_in_world) {
  std::array<Eigen::Vector3d, 3> in_cam;
  for (size_t k = 0; k < 3; ++k) {
    in_cam[k] = camera.CamFromWorld(triangle_in_world[k]);
    if (!(in_cam[k].z() > 0)) return std::nullopt;
  }
  return in_cam;
}

}  // namespace

GapWitness::GapWitness(const SurfaceWitness& witness, double reach)
    : witness_(witness),
      sight_(witness.surface().lattice, HasPatch(witness.surface())),
      longest_px_(reach * std::max(witness.surface().camera.width, witness.surface().camera.height)) {}

double SurfaceWitness::DepthAt(int column, int row) const {
  const int32_t patch = finder_.At(surface_.lattice.Index(column, row));
  if (patch == PatchFinder::kNone || surface_.IsInferred(static_cast<size_t>(patch))) return 0;
  return surface_.depth[static_cast<size_t>(patch)];
}

bool SurfaceWitness::Measured(const Eigen::Vector3d& x_in_world, double radius) const {
  const Eigen::Vector3d x = surface_.camera.CamFromWorld(x_in_world);
  if (!(x.z() > radius)) return false;
  const Lattice& lattice = surface_.lattice;
  const Eigen::Vector2d at = lattice.FromPixel(surface_.camera.ProjectFromCam(x));
  if (!(at.x() >= 0 && at.y() >= 0 && at.x() < lattice.columns - 1 && at.y() < lattice.rows - 1)) return false;
  for (const int row : {static_cast<int>(at.y()), static_cast<int>(at.y()) + 1}) {
    for (const int column : {static_cast<int>(at.x()), static_cast<int>(at.x()) + 1}) {
      const double depth = DepthAt(column, row);
      if (depth > 0 && std::abs(depth - x.z()) <= radius) return true;
    }
  }
  return false;
}

bool GapWitness::Vouches(const std::array<Eigen::Vector3d, 3>& triangle_in_world) const {
  const Camera& camera = witness_.surface().camera;
  const auto triangle_in_cam = InCam(camera, triangle_in_world);
  if (!triangle_in_cam.has_value()) return false;
  const auto& [a, b, c] = *triangle_in_cam;
  const Eigen::Vector3d middle = (a + b + c) / 3;
  const Eigen::Vector3d normal = (b - a).cross(c - a).normalized();
  if (normal.dot(-middle.normalized()) < kMinCosine) return false;
  const double longest = std::sqrt(std::max({(a - b).squaredNorm(), (b - c).squaredNorm(), (c - a).squaredNorm()}));
  if (longest * camera.focal() > longest_px_ * middle.z()) return false;
  const Lattice& lattice = witness_.surface().lattice;
  const Eigen::Vector2d at = lattice.FromPixel(camera.ProjectFromCam(middle));
  const auto column = static_cast<int>(std::lround(at.x()));
  const auto row = static_cast<int>(std::lround(at.y()));
  if (!lattice.Contains(column, row)) return false;
  const double depth = witness_.DepthAt(column, row);
  if (depth > 0 && depth < middle.z() - kClearance * LevelOfDetail(camera, depth, lattice.step)) return false;
  const int reach = static_cast<int>(longest_px_ / lattice.step);
  int surrounded = 0;
  for (int direction = 0; direction < LatticeSight::kDirections; ++direction) {
    if (sight_.StepsTo(column, row, direction, reach) > 0) ++surrounded;
  }
  return surrounded >= kMinDirections;
}

int64_t SurfaceWitness::CountLooksThrough(const std::array<Eigen::Vector3d, 3>& triangle_in_world) const {
  const auto in_cam = InCam(surface_.camera, triangle_in_world);
  if (!in_cam.has_value()) return 0;
  const std::array<Eigen::Vector3d, 3>& triangle_in_cam = *in_cam;
  const Lattice& lattice = surface_.lattice;
  std::array<Eigen::Vector2d, 3> at;
  Eigen::Vector2d low(lattice.columns, lattice.rows);
  Eigen::Vector2d high(-1, -1);
  for (size_t k = 0; k < 3; ++k) {
    at[k] = lattice.FromPixel(surface_.camera.ProjectFromCam(triangle_in_cam[k]));
    low = low.cwiseMin(at[k]);
    high = high.cwiseMax(at[k]);
  }
  if (!(high.x() >= 0 && high.y() >= 0 && low.x() <= lattice.columns - 1 && low.y() <= lattice.rows - 1)) return 0;
  const Eigen::Vector2d ab = at[1] - at[0];
  const Eigen::Vector2d ac = at[2] - at[0];
  const double area = ab.x() * ac.y() - ab.y() * ac.x();
  if (area == 0) return 0;
  const double w_a = 1 / triangle_in_cam[0].z();
  const double w_b = 1 / triangle_in_cam[1].z();
  const double w_c = 1 / triangle_in_cam[2].z();
  int64_t count = 0;
  const int last_row = static_cast<int>(std::min<double>(high.y(), lattice.rows - 1));
  const int last_column = static_cast<int>(std::min<double>(high.x(), lattice.columns - 1));
  for (auto row = static_cast<int>(std::ceil(std::max(low.y(), 0.0))); row <= last_row; ++row) {
    for (auto column = static_cast<int>(std::ceil(std::max(low.x(), 0.0))); column <= last_column; ++column) {
      const Eigen::Vector2d ap = Eigen::Vector2d(column, row) - at[0];
      const double b = (ap.x() * ac.y() - ap.y() * ac.x()) / area;
      const double c = (ab.x() * ap.y() - ab.y() * ap.x()) / area;
      if (b < 0 || c < 0 || b + c > 1) continue;
      const int32_t patch = finder_.At(lattice.Index(column, row));
      if (patch == PatchFinder::kNone) continue;
      const double depth = surface_.depth[static_cast<size_t>(patch)];
      const double z = 1 / ((1 - b - c) * w_a + b * w_b + c * w_c);  // inverse depth is linear in the picture
      if (depth > z + kClearance * LevelOfDetail(surface_.camera, depth, lattice.step)) ++count;
    }
  }
  return count;
}

}  // namespace meshwright
