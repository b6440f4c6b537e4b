// SPDX-License-Identifier: Apache-2.0
#include "worker/seeding/point_seeds.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>

#include <Eigen/Core>

#include "worker/seeding/pixel_index.h"
#include "worker/seeding/plane_search.h"

namespace meshwright {
namespace {

constexpr int kCellSize = 32;                 // px, of the index of points
constexpr int kNeighbours = 12;               // points that a plane is fitted to
constexpr float kMaxNeighbourDistance = 128;  // px
// Neighbours that leave a first plane by more than this share of their inverse depth belong to another surface.
constexpr float kMaxResidual = 0.01F;
// Steeper planes (tangent of the angle from facing) are not proposed.
constexpr float kMaxTilt = 8;
// A slope that scores so well needs no rivals.
constexpr float kGoodScore = 0.85F;
// Below this, the point's image is searched further away.
constexpr float kPoorScore = 0.6F;
constexpr int kDepthReach = 1;  // px, and further where that finds nothing: accuracy of sparse points' images
constexpr int kLongDepthReach = 2;
constexpr float kFirstStep = 0.5F;  // px
constexpr int kRefinementRounds = 2;
constexpr int kMaxSearchTargets = 3;  // more add little to finding a plane
// Windows beside the seed's that must match too: points are known to be matches, and may lie on thin things.
constexpr int kMinContinued = 1;

struct Projected {
  Eigen::Vector2f pixel;
  float w = 0;  // inverse depth
  uint32_t seen_by = 0;
};

// Least squares slope of the plane through point i and its neighbours, point i itself held.
std::optional<RelativeSlope> SlopeFromNeighbours(const std::vector<Projected>& points, const PixelIndex& index,
                                                 size_t i, double focal) {
  const Projected& center = points[i];
  const std::vector<int32_t> near = index.FindNearest(center.pixel, kNeighbours + 1, kMaxNeighbourDistance);
  std::optional<RelativeSlope> slope;
  for (int pass = 0; pass < 2; ++pass) {
    double xx = 0, xy = 0, yy = 0, xw = 0, yw = 0;
    int used = 0;
    for (const int32_t k : near) {
      const Projected& other = points[static_cast<size_t>(k)];
      const Eigen::Vector2f d = other.pixel - center.pixel;
      const float change = other.w / center.w - 1;
      const float distance_squared = d.squaredNorm();
      if (distance_squared < 1) continue;
      if (slope && std::abs(change - slope->dot(d)) > kMaxResidual) continue;
      const double weight = 1.0 / distance_squared;
      xx += weight * d.x() * d.x();
      xy += weight * d.x() * d.y();
      yy += weight * d.y() * d.y();
      xw += weight * d.x() * change;
      yw += weight * d.y() * change;
      ++used;
    }
    const double determinant = xx * yy - xy * xy;
    // Neighbours along one line say nothing about the slope across it.
    if (used < 4 || !(determinant > 0.02 * (xx + yy) * (xx + yy))) return std::nullopt;
    slope = RelativeSlope(static_cast<float>((xw * yy - yw * xy) / determinant),
                          static_cast<float>((yw * xx - xw * xy) / determinant));
  }
  if (!(slope->norm() * focal < kMaxTilt)) return std::nullopt;
  return slope;
}

uint32_t FirstBits(uint32_t bits, int count) {
  uint32_t first = 0;
  for (; count > 0 && bits != 0; --count) {
    first |= bits & (~bits + 1);
    bits &= bits - 1;
  }
  return first;
}

SeedFitter::Outcome SeedPoint(const SeedFitter& fitter, const Projected& point,
                              const std::optional<RelativeSlope>& neighbours_slope, Seed& seed) {
  const PatchScorer& scorer = fitter.scorer();
  const SeedFitter::Node node = fitter.NodeAt(static_cast<int>(point.pixel.x()), static_cast<int>(point.pixel.y()));
  if (!node.window.usable) return SeedFitter::Outcome::kInconsistent;
  const float dx = static_cast<float>(node.x) + 0.5F - point.pixel.x();
  const float dy = static_cast<float>(node.y) + 0.5F - point.pixel.y();
  if (point.w < fitter.MinInverseDepth(node.index)) return SeedFitter::Outcome::kHidden;
  const uint32_t measurable = fitter.TargetsFor(node.x, node.y, point.w);
  const uint32_t observers = measurable & point.seen_by;
  const uint32_t targets = FirstBits(observers != 0 ? observers : measurable, kMaxSearchTargets);
  if (targets == 0) return SeedFitter::Outcome::kInconsistent;

  const PatchObjective objective(scorer, node.window, node.x, node.y, targets);
  ScoredPlane best;
  const auto propose = [&](const RelativeSlope& slope, int reach) {
    const PatchPlane plane = PlaneWithSlope(point.w, slope).MovedBy(dx, dy);
    if (!(plane.w > 0)) return;
    const ScoredPlane found = SearchDepth(objective, plane.w, RelativeSlope(plane.gx, plane.gy) / plane.w, reach);
    if (found.score > best.score) best = found;
  };
  const RelativeSlope facing = FacingSlope(scorer.reference(), node.x, node.y);
  if (neighbours_slope) propose(*neighbours_slope, kDepthReach);
  if (best.score < kGoodScore) propose(facing, kDepthReach);
  if (best.score < kGoodScore) {
    for (const RelativeSlope& slope : TiltedSlopes(scorer.reference(), node.x, node.y)) propose(slope, kDepthReach);
  }
  if (best.score < kPoorScore) {
    propose(facing, kLongDepthReach);
    if (neighbours_slope) propose(*neighbours_slope, kLongDepthReach);
  }
  if (best.score <= 0) return SeedFitter::Outcome::kInconsistent;
  const PatchPlane plane = RefinePlane(objective, best, kFirstStep, kRefinementRounds).plane;
  return fitter.Fit(node, plane, kMinContinued, seed);
}

}  // namespace

PointSeeds SeedPoints(const SeedFitter& fitter, const std::vector<SparsePointObservation>& points, ThreadPool& pool) {
  const Camera& reference = fitter.scorer().reference();
  std::vector<Projected> projected;
  for (const SparsePointObservation& point : points) {
    const Eigen::Vector3d x_in_cam = reference.CamFromWorld(point.x_in_world);
    if (!(x_in_cam.z() > 0)) continue;
    const Eigen::Vector2d pixel = reference.ProjectFromCam(x_in_cam);
    const auto w = static_cast<float>(1 / x_in_cam.z());
    if (!reference.Contains(pixel) || !std::isfinite(w)) continue;
    projected.push_back({pixel.cast<float>(), w, point.seen_by});
  }
  // From here on the order of the points in their file is forgotten.
  std::sort(projected.begin(), projected.end(), [](const Projected& a, const Projected& b) {
    return std::make_tuple(a.pixel.y(), a.pixel.x(), a.w, a.seen_by) <
           std::make_tuple(b.pixel.y(), b.pixel.x(), b.w, b.seen_by);
  });
  std::vector<Eigen::Vector2f> pixels;
  pixels.reserve(projected.size());
  for (const Projected& point : projected) pixels.push_back(point.pixel);
  const PixelIndex index(reference.width, reference.height, kCellSize, pixels);

  std::vector<Seed> seeds(projected.size());
  std::vector<SeedFitter::Outcome> outcomes(projected.size());
  pool.ParallelFor(static_cast<int64_t>(projected.size()), 64, [&](int64_t begin, int64_t end) {
    for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
      const auto slope = SlopeFromNeighbours(projected, index, i, reference.focal());
      outcomes[i] = SeedPoint(fitter, projected[i], slope, seeds[i]);
    }
  });
  PointSeeds result;
  for (size_t i = 0; i < seeds.size(); ++i) {
    switch (outcomes[i]) {
      case SeedFitter::Outcome::kSeed:
        result.seeds.push_back(seeds[i]);
        break;
      case SeedFitter::Outcome::kHidden:
        ++result.hidden;
        break;
      case SeedFitter::Outcome::kInconsistent:
        ++result.inconsistent;
        break;
    }
  }
  return result;
}

}  // namespace meshwright
