#include "worker/seeding/seed_fitter.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

#include "common/geometry/level_of_detail.h"
#include "worker/seeding/plane_search.h"

namespace meshwright {
namespace {

// Under wider angles two photographs show a surface too differently for windows to be compared.
constexpr double kMaxApicalAngleDeg = 60;
// NCC with which a target takes part in refining a seed that is not yet refined.
constexpr float kMinRoughNcc = 0.45F;
constexpr int kRefinementRounds = 3;
// A patch this close to the accepted surface is the accepted surface (section 3.7: 3 d_r).
constexpr float kAcceptedDistance = 3;
// Accepted patches of neighbouring rays belong to one surface when their inverse depths differ less, relatively.
constexpr float kMaxStepOnSurface = 0.05F;

}  // namespace

SeedFitter::SeedFitter(const PatchScorer& scorer, const AcceptedDepth& accepted, const Lattice& lattice,
                       const SeedingOptions& options)
    : scorer_(scorer), accepted_(accepted), lattice_(lattice), options_(options) {
  constexpr double kRadians = std::numbers::pi / 180;
  const double min_angle = std::max(options.min_apical_angle_deg, 1e-3) * kRadians;
  const double max_angle = std::max(kMaxApicalAngleDeg * kRadians, min_angle);
  for (int i = 0; i < scorer.targets(); ++i) {
    epipolar_.emplace_back(scorer.reference(), scorer.target(i).camera, min_angle, max_angle);
  }
}

SeedFitter::Node SeedFitter::NodeAt(int x, int y) const {
  const int column = std::clamp(x / lattice_.step, 0, lattice_.columns - 1);
  const int row = std::clamp(y / lattice_.step, 0, lattice_.rows - 1);
  Node node;
  node.index = static_cast<int32_t>(lattice_.Index(column, row));
  node.x = lattice_.PixelX(column);
  node.y = lattice_.PixelY(row);
  scorer_.MakeWindow(node.x, node.y, node.window);
  return node;
}

float SeedFitter::MinInverseDepth(int32_t node) const {
  const float depth = accepted_.depth[static_cast<size_t>(node)];
  if (depth <= 0) return 0;
  const auto limit =
      static_cast<float>(depth - kAcceptedDistance * LevelOfDetail(scorer_.reference(), depth, lattice_.step));
  return limit > 0 ? 1 / limit : std::numeric_limits<float>::infinity();
}

std::optional<PatchPlane> SeedFitter::AcceptedPlane(int32_t node) const {
  const float depth = accepted_.depth[static_cast<size_t>(node)];
  if (depth <= 0) return std::nullopt;
  const float w = 1 / depth;
  const int column = node % lattice_.columns;
  const int row = node / lattice_.columns;
  // Slope towards a neighbour on either side that belongs to the same surface, 0 if there is none.
  const auto slope = [&](int dx, int dy) {
    for (const int side : {1, -1}) {
      if (!lattice_.Contains(column + side * dx, row + side * dy)) continue;
      const float there = accepted_.depth[static_cast<size_t>(lattice_.Index(column + side * dx, row + side * dy))];
      if (there <= 0) continue;
      const float change = 1 / there - w;
      if (std::abs(change) < kMaxStepOnSurface * w) return change / static_cast<float>(side * lattice_.step);
    }
    return 0.0F;
  };
  return PatchPlane{w, slope(1, 0), slope(0, 1)};
}

uint32_t SeedFitter::TargetsFor(int x, int y, float w) const {
  uint32_t targets = 0;
  for (size_t i = 0; i < epipolar_.size(); ++i) {
    if (!epipolar_[i].SegmentOf(x + 0.5, y + 0.5, w, w).empty()) targets |= 1U << i;
  }
  return targets;
}

uint32_t SeedFitter::TargetsThatAgree(const Node& node, const PatchPlane& plane, uint32_t targets, float min_ncc,
                                      float& sum) const {
  uint32_t agreeing = 0;
  for (int i = 0; i < scorer_.targets(); ++i) {
    if ((targets >> i & 1U) == 0) continue;
    const float ncc = scorer_.Score(node.window, node.x, node.y, plane, i);
    if (ncc < min_ncc) continue;
    agreeing |= 1U << i;
    sum += ncc;
  }
  return agreeing;
}

SeedFitter::Outcome SeedFitter::Fit(const Node& node, const PatchPlane& plane, Seed& seed) const {
  if (!node.window.usable || !(plane.w > 0)) return Outcome::kInconsistent;
  const float min_w = MinInverseDepth(node.index);
  if (plane.w < min_w) return Outcome::kHidden;
  const uint32_t candidates = TargetsFor(node.x, node.y, plane.w);
  float sum = 0;
  const uint32_t rough = TargetsThatAgree(node, plane, candidates, kMinRoughNcc, sum);
  if (rough == 0) return Outcome::kInconsistent;
  const ScoredPlane start{plane, sum / static_cast<float>(std::popcount(rough))};
  const ScoredPlane refined =
      RefinePlane(PatchObjective(scorer_, node.window, node.x, node.y, rough), start, kRefinementRounds);
  const uint32_t measurable = TargetsFor(node.x, node.y, refined.plane.w);
  sum = 0;
  const uint32_t sigma = TargetsThatAgree(node, refined.plane, measurable, kMinTargetNcc, sum);
  if (sigma == 0) return Outcome::kInconsistent;
  const float quality = sum / static_cast<float>(std::popcount(sigma));
  if (quality < options_.min_quality) return Outcome::kInconsistent;
  if (refined.plane.w < min_w) return Outcome::kHidden;
  seed = {node.index, refined.plane, sigma, quality};
  return Outcome::kSeed;
}

}  // namespace meshwright
