#include "common/mesh/surface_overlap.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "common/base/check.h"
#include "common/geometry/level_of_detail.h"
#include "common/surface/triangulation.h"

namespace meshwright {
namespace {

constexpr int kTile = 16;  // nodes
constexpr int64_t kRowsAtOnce = 8;
constexpr float kMinNormalCosine = 0.5F;  // 60 degrees

}  // namespace

SurfaceOutline::SurfaceOutline(const PatchLattice& surface)
    : camera_(surface.camera),
      lattice_(surface.lattice),
      tile_columns_((lattice_.columns + kTile - 1) / kTile),
      tile_rows_((lattice_.rows + kTile - 1) / kTile),
      nearest_(static_cast<size_t>(tile_columns_) * tile_rows_, 0.0F),
      farthest_(nearest_.size(), 0.0F) {
  std::vector<Eigen::Vector3d> points;
  size_t tile = 0;
  for (int tile_row = 0; tile_row < tile_rows_; ++tile_row) {
    for (int tile_column = 0; tile_column < tile_columns_; ++tile_column, ++tile) {
      points.clear();
      for (int row = kTile * tile_row; row < std::min(kTile * (tile_row + 1), lattice_.rows); ++row) {
        for (int column = kTile * tile_column; column < std::min(kTile * (tile_column + 1), lattice_.columns);
             ++column) {
          const float depth = surface.depth[static_cast<size_t>(lattice_.Index(column, row))];
          if (!(depth > 0)) continue;
          nearest_[tile] = points.empty() ? depth : std::min(nearest_[tile], depth);
          farthest_[tile] = std::max(farthest_[tile], depth);
          points.push_back(surface.Point(column, row));
        }
      }
      if (points.empty()) continue;
      Eigen::Vector3d center = Eigen::Vector3d::Zero();
      for (const Eigen::Vector3d& x : points) center += x / static_cast<double>(points.size());
      double squared_radius = 0;
      for (const Eigen::Vector3d& x : points) squared_radius = std::max(squared_radius, (x - center).squaredNorm());
      balls_.push_back({center.cast<float>(), static_cast<float>(1.01 * std::sqrt(squared_radius))});
    }
  }
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

CoveringSurface::CoveringSurface(PatchLattice moved) : surface(std::move(moved)) {
  in_triangle.assign(surface.depth.size(), 0);
  for (const auto& triangle : TriangulateLattice(surface)) {
    for (const int32_t node : triangle) in_triangle[static_cast<size_t>(node)] = 1;
  }
}

void MarkCovered(const PatchLattice& surface, const CoveringSurface& cover, double margin_steps, ThreadPool& pool,
                 std::vector<uint8_t>& removed) {
  MW_CHECK(removed.size() == surface.depth.size());
  const PatchLattice& other = cover.surface;
  const auto covers = [&](int column, int row, size_t node) {
    const Eigen::Vector3d x = surface.Point(column, row);
    const Eigen::Vector3d x_in_cam = other.camera.CamFromWorld(x);
    if (!(x_in_cam.z() > 0)) return false;
    const Eigen::Vector2d at = other.lattice.FromPixel(other.camera.ProjectFromCam(x_in_cam));
    if (!(at.x() > -0.5 && at.y() > -0.5 && at.x() < other.lattice.columns && at.y() < other.lattice.rows)) {
      return false;
    }
    const int other_column = static_cast<int>(std::floor(at.x() + 0.5));
    const int other_row = static_cast<int>(std::floor(at.y() + 0.5));
    if (!other.lattice.Contains(other_column, other_row)) return false;
    const auto other_node = static_cast<size_t>(other.lattice.Index(other_column, other_row));
    if (cover.in_triangle[other_node] == 0) return false;
    const Eigen::Vector3f& normal = other.normal_in_world[other_node];
    if (!(normal.dot(surface.normal_in_world[node]) > kMinNormalCosine)) return false;
    const double margin =
        margin_steps * std::max(LevelOfDetail(surface.camera, surface.depth[node], surface.lattice.step),
                                LevelOfDetail(other.camera, other.depth[other_node], other.lattice.step));
    return std::abs((x - other.Point(other_column, other_row)).dot(normal.cast<double>())) < margin;
  };
  pool.ParallelFor(surface.lattice.rows, kRowsAtOnce, [&](int64_t begin, int64_t end) {
    for (int row = static_cast<int>(begin); row < end; ++row) {
      for (int column = 0; column < surface.lattice.columns; ++column) {
        const auto node = static_cast<size_t>(surface.lattice.Index(column, row));
        if (surface.depth[node] > 0 && removed[node] == 0 && covers(column, row, node)) removed[node] = 1;
      }
    }
  });
}

}  // namespace meshwright
