// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/surface_overlap.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "common/base/check.h"
#include "common/geometry/level_of_detail.h"
#include "common/surface/triangulation.h"

namespace meshwright {
namespace {

constexpr int kTile = 16;  // nodes
constexpr int64_t kPatchesAtOnce = 8192;
constexpr float kMinNormalCosine = 0.5F;  // 60 degrees

}  // namespace

MeasuredSpace MeasuredSpace::Of(const SparseSurface& surface) {
  MeasuredSpace space = {.camera = surface.camera};
  if (!surface.depth.empty()) {
    const auto [nearest, farthest] = std::ranges::minmax_element(surface.depth);
    space.nearest = *nearest;
    space.farthest = *farthest;
  }
  return space;
}

bool MeasuredSpace::MayReach(const Eigen::Vector3d& x_in_world, double radius) const {
  const Eigen::Vector3d x = camera.CamFromWorld(x_in_world);
  if (!(farthest > 0) || x.z() + radius < nearest || x.z() - radius > farthest) return false;
  // Distances from the four planes through the camera's centre and the picture's sides.
  const auto is_beyond = [&](double focal, double center_px, double size_px, double across) {
    const double low = center_px / focal;
    const double high = (size_px - center_px) / focal;
    return -across - low * x.z() > radius * std::hypot(1, low) || across - high * x.z() > radius * std::hypot(1, high);
  };
  return !is_beyond(camera.fx, camera.cx, camera.width, x.x()) &&
         !is_beyond(camera.fy, camera.cy, camera.height, x.y());
}

SurfaceOutline::SurfaceOutline(const SparseSurface& surface)
    : camera_(surface.camera),
      lattice_(surface.lattice),
      tile_columns_((lattice_.columns + kTile - 1) / kTile),
      tile_rows_((lattice_.rows + kTile - 1) / kTile),
      nearest_(static_cast<size_t>(tile_columns_) * tile_rows_, 0.0F),
      farthest_(nearest_.size(), 0.0F) {
  std::vector<std::vector<Eigen::Vector3d>> points(static_cast<size_t>(tile_columns_));  // of one row of tiles
  size_t patch = 0;
  for (int tile_row = 0; tile_row < tile_rows_ && patch < surface.patches(); ++tile_row) {
    const int64_t end = lattice_.Index(0, std::min(kTile * (tile_row + 1), lattice_.rows));
    for (; patch < surface.patches() && surface.node[patch] < end; ++patch) {
      const int tile_column = surface.Column(patch) / kTile;
      const size_t tile = static_cast<size_t>(tile_row) * tile_columns_ + tile_column;
      const float depth = surface.depth[patch];
      nearest_[tile] = nearest_[tile] > 0 ? std::min(nearest_[tile], depth) : depth;
      farthest_[tile] = std::max(farthest_[tile], depth);
      points[static_cast<size_t>(tile_column)].push_back(surface.Point(patch));
    }
    for (std::vector<Eigen::Vector3d>& in_tile : points) {
      if (in_tile.empty()) continue;
      balls_.push_back(BallAround(in_tile));
      in_tile.clear();
    }
  }
  if (balls_.empty()) return;
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  for (const Ball& ball : balls_) center += ball.center_in_world.cast<double>() / static_cast<double>(balls_.size());
  around_all_.center_in_world = center.cast<float>();
  for (const Ball& ball : balls_) {
    around_all_.radius = std::max(around_all_.radius,
                                  1.01F * ((ball.center_in_world - around_all_.center_in_world).norm() + ball.radius));
  }
}

SurfaceOutline::Ball SurfaceOutline::BallAround(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& x : points) center += x / static_cast<double>(points.size());
  double squared_radius = 0;
  for (const Eigen::Vector3d& x : points) squared_radius = std::max(squared_radius, (x - center).squaredNorm());
  return {center.cast<float>(), static_cast<float>(1.01 * std::sqrt(squared_radius))};
}

bool SurfaceOutline::MayContain(const Ball& ball, double margin_steps) const {
  const Eigen::Vector3d x_in_cam = camera_.CamFromWorld(ball.center_in_world.cast<double>());
  const double nearest = x_in_cam.z() - ball.radius;
  if (x_in_cam.z() + ball.radius <= 0) return false;
  if (nearest <= 0) return true;
  const double margin = margin_steps * LevelOfDetail(camera_, x_in_cam.z() + ball.radius, lattice_.step);
  const Eigen::Vector2d node = lattice_.FromPixel(camera_.ProjectFromCam(x_in_cam));
  // A ball's projection is an ellipse that grows towards the rim of the picture: twice the radius is enough up to a
  // field of view of 120 degrees.
  const double reach = 2 * std::max(camera_.fx, camera_.fy) * ball.radius / nearest / lattice_.step + 1;
  const auto tile_of = [](double position, int tiles) {
    return static_cast<int>(std::clamp(std::floor(position / kTile), -1.0, static_cast<double>(tiles)));
  };
  const int last_row = std::min(tile_of(node.y() + reach, tile_rows_), tile_rows_ - 1);
  const int last_column = std::min(tile_of(node.x() + reach, tile_columns_), tile_columns_ - 1);
  for (int row = std::max(0, tile_of(node.y() - reach, tile_rows_)); row <= last_row; ++row) {
    for (int column = std::max(0, tile_of(node.x() - reach, tile_columns_)); column <= last_column; ++column) {
      const size_t tile = static_cast<size_t>(row) * tile_columns_ + column;
      if (!(nearest_[tile] > 0)) continue;
      if (nearest_[tile] - margin <= x_in_cam.z() + ball.radius && farthest_[tile] + margin >= nearest) return true;
    }
  }
  return false;
}

bool SurfaceOutline::MayOverlap(const SurfaceOutline& other, double margin_steps) const {
  return std::ranges::any_of(balls_, [&](const Ball& ball) { return other.MayContain(ball, margin_steps); });
}

bool SurfaceOutline::MayOverlap(const MeasuredSpace& other, const Lattice& lattice, double margin_steps) const {
  if (balls_.empty()) return false;
  const Eigen::Vector3d center = around_all_.center_in_world.cast<double>();
  const double farthest = other.camera.CamFromWorld(center).z() + around_all_.radius;
  if (!(farthest > 0)) return false;
  const double margin = margin_steps * LevelOfDetail(other.camera, farthest, lattice.step);
  return other.MayReach(center, around_all_.radius + margin);
}

int64_t SurfaceOutline::bytes() const {
  return static_cast<int64_t>(sizeof(SurfaceOutline) + nearest_.size() * 2 * sizeof(float) +
                              balls_.size() * sizeof(Ball));
}

std::vector<bool> CornersOfTriangles(const SparseSurface& surface) {
  std::vector<bool> in_triangle(surface.patches(), false);
  for (const auto& triangle : Triangulate(surface)) {
    for (const int32_t patch : triangle) in_triangle[static_cast<size_t>(patch)] = true;
  }
  return in_triangle;
}

void MarkCovered(const SparseSurface& surface, const SparseSurface& cover, const std::vector<bool>& in_triangle,
                 double margin_steps, ThreadPool& pool, std::vector<uint8_t>& removed) {
  MW_CHECK(removed.size() == surface.patches() && in_triangle.size() == cover.patches());
  const PatchFinder finder(cover);
  const auto is_covered = [&](size_t patch) {
    const Eigen::Vector3d x = surface.Point(patch);
    const Eigen::Vector3d x_in_cam = cover.camera.CamFromWorld(x);
    if (!(x_in_cam.z() > 0)) return false;
    const Eigen::Vector2d at = cover.lattice.FromPixel(cover.camera.ProjectFromCam(x_in_cam));
    if (!(at.x() > -0.5 && at.y() > -0.5 && at.x() < cover.lattice.columns && at.y() < cover.lattice.rows)) {
      return false;
    }
    const int column = static_cast<int>(std::floor(at.x() + 0.5));
    const int row = static_cast<int>(std::floor(at.y() + 0.5));
    if (!cover.lattice.Contains(column, row)) return false;
    const int32_t found = finder.At(cover.lattice.Index(column, row));
    if (found == PatchFinder::kNone) return false;
    const auto other = static_cast<size_t>(found);
    if (!in_triangle[other]) return false;
    const Eigen::Vector3f& normal = cover.normal_in_world[other];
    if (!(normal.dot(surface.normal_in_world[patch]) > kMinNormalCosine)) return false;
    const double margin =
        margin_steps * std::max(LevelOfDetail(surface.camera, surface.depth[patch], surface.lattice.step),
                                LevelOfDetail(cover.camera, cover.depth[other], cover.lattice.step));
    return std::abs((x - cover.Point(other)).dot(normal.cast<double>())) < margin;
  };
  pool.ParallelFor(static_cast<int64_t>(removed.size()), kPatchesAtOnce, [&](int64_t begin, int64_t end) {
    for (auto patch = static_cast<size_t>(begin); patch < static_cast<size_t>(end); ++patch) {
      if (removed[patch] == 0 && is_covered(patch)) removed[patch] = 1;
    }
  });
}

}  // namespace meshwright
