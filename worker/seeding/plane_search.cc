// SPDX-License-Identifier: Apache-2.0
#include "worker/seeding/plane_search.h"

#include <algorithm>
#include <cmath>

#include "common/base/check.h"

namespace meshwright {
namespace {

// RefinePlane's step of slopes, per px from the patch's centre, as a share of its step of inverse depth: both move the
// windows' borders about alike.
constexpr float kSlopeShare = 0.3F;

PatchPlane Moved(const PatchPlane& plane, int parameter, float by) {
  PatchPlane moved = plane;
  (parameter == 0 ? moved.w : parameter == 1 ? moved.gx : moved.gy) += by;
  return moved;
}

}  // namespace

RelativeSlope FacingSlope(const Camera& reference, int x, int y) {
  // 1/z = n . r(x, y) / (z0 n . r0) with n = r0.
  const Eigen::Vector3d ray = reference.RayInCam(x + 0.5, y + 0.5);
  const double squared = ray.squaredNorm();
  return {static_cast<float>(ray.x() / (reference.fx * squared)),
          static_cast<float>(ray.y() / (reference.fy * squared))};
}

std::array<RelativeSlope, 4> TiltedSlopes(const Camera& reference, int x, int y) {
  const RelativeSlope facing = FacingSlope(reference, x, y);
  const auto tilt = static_cast<float>(1.0 / reference.focal());
  return {facing + RelativeSlope(tilt, 0), facing - RelativeSlope(tilt, 0), facing + RelativeSlope(0, tilt),
          facing - RelativeSlope(0, tilt)};
}

PatchObjective::PatchObjective(const PatchScorer& scorer, const PatchScorer::Window& window, int x, int y,
                               uint32_t targets)
    : scorer_(scorer), window_(window), x_(x), y_(y), targets_{} {
  MW_CHECK(targets != 0 && scorer.targets() <= static_cast<int>(targets_.size()));
  for (int i = 0; i < scorer.targets(); ++i) {
    if ((targets >> i & 1U) != 0) targets_[count_++] = i;
  }
}

float PatchObjective::operator()(const PatchPlane& plane) const {
  float sum = 0;
  for (size_t k = 0; k < count_; ++k) sum += std::max(scorer_.Score(window_, x_, y_, plane, targets_[k]), -1.0F);
  return sum / static_cast<float>(count_);
}

float PatchObjective::InverseDepthPerPixel(float w) const {
  float fastest = 0;
  for (size_t k = 0; k < count_; ++k) {
    const float speed = scorer_.PixelsPerInverseDepth(x_, y_, w, targets_[k]);
    if (std::isfinite(speed)) fastest = std::max(fastest, speed);
  }
  return fastest > 0 ? 1.0F / fastest : 0.0F;
}

ScoredPlane SearchDepth(const PatchObjective& objective, float w, const RelativeSlope& slope, int reach) {
  const float unit = objective.InverseDepthPerPixel(w);
  ScoredPlane best;
  for (int half = -2 * reach; half <= 2 * reach; ++half) {
    const float moved = w + 0.5F * static_cast<float>(half) * unit;
    if (moved <= 0) continue;
    const PatchPlane plane = PlaneWithSlope(moved, slope);
    const float score = objective(plane);
    if (score > best.score) best = {plane, score};
  }
  return best;
}

ScoredPlane RefinePlane(const PatchObjective& objective, const ScoredPlane& start, float first_step, int rounds) {
  float depth_step = first_step * objective.InverseDepthPerPixel(start.plane.w);
  ScoredPlane best = start;
  const auto consider = [&](const PatchPlane& plane) {
    const float score = plane.w > 0 ? objective(plane) : PatchScorer::kNoScore;
    if (score > best.score) best = {plane, score};
    return score;
  };
  for (int round = 0; round < rounds; ++round, depth_step *= 0.5F) {
    for (const int parameter : {0, 1, 2}) {
      const float step = parameter == 0 ? depth_step : kSlopeShare * depth_step;
      const ScoredPlane middle = best;
      const float lower = consider(Moved(middle.plane, parameter, -step));
      const float upper = consider(Moved(middle.plane, parameter, step));
      const float curvature = lower - 2 * middle.score + upper;
      if (curvature < 0) {
        const float peak = std::clamp(0.5F * (lower - upper) / curvature, -1.5F, 1.5F);
        consider(Moved(middle.plane, parameter, peak * step));
      }
    }
  }
  return best;
}

}  // namespace meshwright
