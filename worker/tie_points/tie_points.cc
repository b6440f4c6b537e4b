// SPDX-License-Identifier: Apache-2.0
#include "worker/tie_points/tie_points.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

namespace meshwright {
namespace {

constexpr float kMinNcc = 0.8F;
// Of a peak, NCC for each square pixel.
constexpr float kMinCurvature = 0.03F;
constexpr float kFineStep = 0.5F;      // px
constexpr float kLargestStep = 0.75F;  // px, from the best of the fine steps to the peak
constexpr int64_t kSeedsAtOnce = 16;

// What the image of the window in one target is worth when it is moved.
class ShiftedScore {
 public:
  ShiftedScore(const PatchScorer& scorer, const PatchScorer::Window& window, int x, int y, const PatchPlane& plane,
               int target)
      : scorer_(scorer), window_(window), x_(x), y_(y), plane_(plane), target_(target) {}

  // At nine places `step` px apart around a shift, row by row.
  std::array<float, 9> Around(const Eigen::Vector2f& shift_px, float step) const {
    std::array<float, 9> scores{};
    for (int i = 0; i < 9; ++i) {
      const Eigen::Vector2f beside(static_cast<float>(i % 3 - 1), static_cast<float>(i / 3 - 1));
      scores[static_cast<size_t>(i)] = scorer_.Score(window_, x_, y_, plane_, target_, shift_px + step * beside);
    }
    return scores;
  }

 private:
  const PatchScorer& scorer_;
  const PatchScorer::Window& window_;
  const int x_;
  const int y_;
  const PatchPlane plane_;
  const int target_;
};

bool HasAll(const std::array<float, 9>& scores) {
  return std::ranges::find(scores, PatchScorer::kNoScore) == scores.end();
}

// From pixel to pixel uphill; none when the way leads out of reach.
std::optional<Eigen::Vector2f> Climb(const ShiftedScore& score) {
  Eigen::Vector2f shift_px = Eigen::Vector2f::Zero();
  while (shift_px.lpNorm<Eigen::Infinity>() < kTieReachPx) {
    const std::array<float, 9> around = score.Around(shift_px, 1);
    if (!HasAll(around)) return std::nullopt;
    size_t best = 4;
    for (size_t i = 0; i < around.size(); ++i) {
      if (around[i] > around[best]) best = i;
    }
    if (best == 4) return shift_px;
    shift_px += Eigen::Vector2f(static_cast<float>(best % 3) - 1, static_cast<float>(best / 3) - 1);
  }
  return std::nullopt;
}

// The peak of the quadric that fits the scores around a shift best.
std::optional<Eigen::Vector2f> Peak(const ShiftedScore& score, const Eigen::Vector2f& shift_px) {
  const std::array<float, 9> s = score.Around(shift_px, kFineStep);
  if (!HasAll(s) || s[4] < kMinNcc) return std::nullopt;
  const Eigen::Vector2f slope((s[2] + s[5] + s[8] - s[0] - s[3] - s[6]) / (6 * kFineStep),
                              (s[6] + s[7] + s[8] - s[0] - s[1] - s[2]) / (6 * kFineStep));
  Eigen::Matrix2f curvature;
  curvature(0, 0) = (s[0] + s[2] + s[3] + s[5] + s[6] + s[8] - 2 * (s[1] + s[4] + s[7])) / 3;
  curvature(1, 1) = (s[0] + s[1] + s[2] + s[6] + s[7] + s[8] - 2 * (s[3] + s[4] + s[5])) / 3;
  curvature(0, 1) = curvature(1, 0) = (s[0] + s[8] - s[2] - s[6]) / 4;
  curvature /= kFineStep * kFineStep;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2f> solver(curvature, Eigen::EigenvaluesOnly);
  if (solver.eigenvalues()[1] > -kMinCurvature) return std::nullopt;
  const Eigen::Vector2f step_px = -curvature.inverse() * slope;
  if (step_px.lpNorm<Eigen::Infinity>() > kLargestStep) return std::nullopt;
  return shift_px + step_px;
}

TiePoint Measure(const PatchScorer& scorer, int x, int y, const Seed& seed) {
  TiePoint tie{.pixel = {static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F}, .sights = {}};
  PatchScorer::Window window;
  scorer.MakeWindow(x, y, window);
  if (!window.usable) return tie;
  const Eigen::Vector3d x_in_world =
      scorer.reference().BackProject(x + 0.5, y + 0.5, 1 / static_cast<double>(seed.plane.w));
  for (uint32_t rest = seed.sigma; rest != 0; rest &= rest - 1) {
    const int target = std::countr_zero(rest);
    const ShiftedScore score(scorer, window, x, y, seed.plane, target);
    const std::optional<Eigen::Vector2f> near = Climb(score);
    if (!near.has_value()) continue;
    const std::optional<Eigen::Vector2f> shift_px = Peak(score, *near);
    if (!shift_px.has_value()) continue;
    const Camera& camera = scorer.target(target).camera;
    tie.sights.push_back({target, camera.ProjectFromCam(camera.CamFromWorld(x_in_world)).cast<float>() + *shift_px});
  }
  return tie;
}

}  // namespace

std::vector<TiePoint> MeasureTiePoints(const PatchScorer& scorer, const Lattice& lattice,
                                       const std::vector<Seed>& seeds, int cells, ThreadPool& pool) {
  std::vector<TiePoint> measured(seeds.size());
  pool.ParallelFor(static_cast<int64_t>(seeds.size()), kSeedsAtOnce, [&](int64_t begin, int64_t end) {
    for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
      const int x = lattice.PixelX(seeds[i].node % lattice.columns);
      const int y = lattice.PixelY(seeds[i].node / lattice.columns);
      measured[i] = Measure(scorer, x, y, seeds[i]);
    }
  });
  const Camera& reference = scorer.reference();
  std::vector<int32_t> best(static_cast<size_t>(cells) * static_cast<size_t>(cells), -1);
  for (size_t i = 0; i < measured.size(); ++i) {
    if (measured[i].sights.empty()) continue;
    const int column = std::min(cells - 1, static_cast<int>(measured[i].pixel.x()) * cells / reference.width);
    const int row = std::min(cells - 1, static_cast<int>(measured[i].pixel.y()) * cells / reference.height);
    int32_t& of_cell = best[static_cast<size_t>(row * cells + column)];
    const auto rank = [&](size_t k) { return std::pair(measured[k].sights.size(), seeds[k].quality); };
    if (of_cell < 0 || rank(i) > rank(static_cast<size_t>(of_cell))) of_cell = static_cast<int32_t>(i);
  }
  std::vector<TiePoint> ties;
  for (const int32_t i : best) {
    if (i >= 0) ties.push_back(std::move(measured[static_cast<size_t>(i)]));
  }
  return ties;
}

}  // namespace meshwright
