// SPDX-License-Identifier: Apache-2.0
#include "worker/seeding/seed_fitter.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <utility>

#include "common/geometry/level_of_detail.h"
#include "worker/seeding/plane_search.h"

namespace meshwright {
namespace {

// Under wider angles two photographs show a surface too differently for windows to be compared.
constexpr double kMaxApicalAngleDeg = 60;
// NCC with which a target takes part in refining a seed that is not yet refined.
constexpr float kMinRoughNcc = 0.45F;
// Refinement: first step, px, and rounds; the best few of the targets are enough.
constexpr float kFirstStep = 0.25F;
constexpr int kRefinementRounds = 2;
constexpr int kMaxRefiningTargets = 4;
// A surface goes on beyond the window: through the seed's plane, windows beside it must match too.
constexpr float kMinContinuedNcc = 0.5F;
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

uint32_t SeedFitter::BestTargets(const Node& node, const PatchPlane& plane, uint32_t targets, float min_ncc,
                                 int count) const {
  std::array<std::pair<float, int>, 32> scored;
  size_t found = 0;
  for (int i = 0; i < scorer_.targets(); ++i) {
    if ((targets >> i & 1U) == 0) continue;
    const float ncc = scorer_.Score(node.window, node.x, node.y, plane, i);
    if (ncc >= min_ncc) scored[found++] = {-ncc, i};
  }
  std::sort(scored.begin(), scored.begin() + static_cast<std::ptrdiff_t>(found));
  uint32_t best = 0;
  for (size_t k = 0; k < std::min(found, static_cast<size_t>(count)); ++k) best |= 1U << scored[k].second;
  return best;
}

int SeedFitter::CountContinued(const Node& node, const PatchPlane& plane, uint32_t sigma) const {
  const int shift = 2 * scorer_.options().window_radius;
  int continued = 0;
  PatchScorer::Window window;
  for (const auto& [dx, dy] : {std::pair{shift, 0}, {-shift, 0}, {0, shift}, {0, -shift}}) {
    const int x = node.x + dx;
    const int y = node.y + dy;
    scorer_.MakeWindow(x, y, window);
    if (!window.usable) continue;
    const PatchObjective objective(scorer_, window, x, y, sigma);
    if (objective(plane.MovedBy(static_cast<float>(dx), static_cast<float>(dy))) >= kMinContinuedNcc) ++continued;
  }
  return continued;
}

SeedFitter::Outcome SeedFitter::Fit(const Node& node, const PatchPlane& plane, int min_continued, Seed& seed) const {
  if (!node.window.usable || !(plane.w > 0)) return Outcome::kInconsistent;
  const float min_w = MinInverseDepth(node.index);
  if (plane.w < min_w) return Outcome::kHidden;
  const uint32_t candidates = TargetsFor(node.x, node.y, plane.w);
  const uint32_t rough = BestTargets(node, plane, candidates, kMinRoughNcc, kMaxRefiningTargets);
  if (rough == 0) return Outcome::kInconsistent;
  const PatchObjective objective(scorer_, node.window, node.x, node.y, rough);
  const ScoredPlane refined = RefinePlane(objective, {plane, objective(plane)}, kFirstStep, kRefinementRounds);
  const uint32_t measurable = TargetsFor(node.x, node.y, refined.plane.w);
  float sum = 0;
  const uint32_t sigma = TargetsThatAgree(node, refined.plane, measurable, kMinTargetNcc, sum);
  if (sigma == 0) return Outcome::kInconsistent;
  const float quality = sum / static_cast<float>(std::popcount(sigma));
  if (quality < options_.min_quality) return Outcome::kInconsistent;
  if (refined.plane.w < min_w) return Outcome::kHidden;
  if (CountContinued(node, refined.plane, sigma) < min_continued) return Outcome::kInconsistent;
  seed = {node.index, refined.plane, sigma, quality};
  return Outcome::kSeed;
}

}  // namespace meshwright
