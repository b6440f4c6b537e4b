// SPDX-License-Identifier: Apache-2.0
#include "worker/filtering/smoothing.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/Core>
#include <Eigen/LU>

#include "common/base/check.h"

namespace meshwright {
namespace {

constexpr int kRowsPerPiece = 4;
constexpr float kRadiusPerUncertainty = 4;  // lattice steps for each footprint of uncertainty
// Two patches are of one surface when they continue each other within so many footprints: this much, and this much for
// each of uncertainty; never more than the last.
constexpr float kGate = 0.25F;
constexpr float kGatePerUncertainty = 3;
constexpr float kMaxGate = 2;
constexpr double kSlopePrior = 2;  // how many neighbours the patch's own slope counts for
constexpr float kStep = 0.7F;      // share of the way to the fitted plane

// The move in inverse depth at one patch.
std::optional<float> MoveToFit(const SurfaceEstimate& surface, const std::vector<float>& uncertainty, float footprint,
                               int radius, int column, int row) {
  const Lattice& lattice = surface.lattice;
  const auto step = static_cast<float>(lattice.step);
  const auto node = static_cast<size_t>(lattice.Index(column, row));
  const PatchPlane& own = surface.plane[node];
  const double own_weight = 1 / (double{uncertainty[node]} * uncertainty[node]);
  // Normal equations of w = own.w + a + b dx + c dy over neighbours at (dx, dy) lattice steps.
  Eigen::Matrix3d normal = Eigen::Vector3d(0, kSlopePrior, kSlopePrior).asDiagonal() * own_weight;
  Eigen::Vector3d right = normal * Eigen::Vector3d(0, own.gx * step, own.gy * step);
  for (int dy = -radius; dy <= radius; ++dy) {
    for (int dx = -radius; dx <= radius; ++dx) {
      if (dx * dx + dy * dy > radius * radius + 1 || !lattice.Contains(column + dx, row + dy)) continue;
      const auto k = static_cast<size_t>(lattice.Index(column + dx, row + dy));
      const PatchPlane& other = surface.plane[k];
      if (!(other.w > 0)) continue;
      const auto x = static_cast<float>(dx);
      const auto y = static_cast<float>(dy);
      const float apart = std::max(std::fabs(other.w - own.MovedBy(step * x, step * y).w),
                                   std::fabs(own.w - other.MovedBy(-step * x, -step * y).w));
      const float gate =
          footprint * std::min(kMaxGate, kGate + kGatePerUncertainty * std::max(uncertainty[k], uncertainty[node]));
      if (!(apart <= gate)) continue;
      const double share = apart / gate;
      const double likeness = (1 - share * share) * (1 - share * share);
      const double weight = likeness / (double{uncertainty[k]} * uncertainty[k]);
      const Eigen::Vector3d v(1, dx, dy);
      normal += weight * v * v.transpose();
      right += weight * (double{other.w} - own.w) * v;
    }
  }
  const double determinant = normal.determinant();
  if (!(determinant > 0)) return std::nullopt;
  const double move = (normal.inverse() * right)[0];
  if (!std::isfinite(move)) return std::nullopt;
  return static_cast<float>(kStep * move);
}

}  // namespace

void SmoothDepth(const std::vector<float>& uncertainty, double focal, int max_radius, SurfaceEstimate& surface,
                 ThreadPool& pool) {
  MW_CHECK(uncertainty.size() == surface.plane.size());
  const Lattice& lattice = surface.lattice;
  std::vector<float> smoothed(surface.plane.size(), 0.0F);
  pool.ParallelFor(lattice.rows, kRowsPerPiece, [&](int64_t begin, int64_t end) {
    for (auto row = static_cast<int>(begin); row < end; ++row) {
      for (int column = 0; column < lattice.columns; ++column) {
        const int64_t index = lattice.Index(column, row);
        if (!surface.HasPatch(index)) continue;
        const auto node = static_cast<size_t>(index);
        const float w = surface.plane[node].w;
        smoothed[node] = w;
        const float reach = kRadiusPerUncertainty * uncertainty[node];
        const int radius =
            reach < static_cast<float>(max_radius) ? std::max(1, static_cast<int>(reach + 0.5F)) : max_radius;
        const auto move =
            MoveToFit(surface, uncertainty, w / static_cast<float>(focal), std::min(radius, max_radius), column, row);
        if (move.has_value() && w + *move > 0) smoothed[node] = w + *move;
      }
    }
  });
  for (size_t node = 0; node < smoothed.size(); ++node) surface.plane[node].w = smoothed[node];
}

}  // namespace meshwright
