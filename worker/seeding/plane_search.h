// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include <Eigen/Core>

#include "common/geometry/camera.h"
#include "worker/photo_consistency/patch_scorer.h"

namespace meshwright {

// Slope of a plane relative to its inverse depth: (gx / w, gy / w), 1 / px. Its length times the focal length is about
// the tangent of the angle between the plane's normal and the ray.
using RelativeSlope = Eigen::Vector2f;

inline PatchPlane PlaneWithSlope(float w, const RelativeSlope& slope) { return {w, w * slope.x(), w * slope.y()}; }

// Slope of the plane whose normal points along the ray through the centre of pixel (x, y).
RelativeSlope FacingSlope(const Camera& reference, int x, int y);

// Slopes of planes turned by 45 degrees away from facing, to the four sides of the image.
std::array<RelativeSlope, 4> TiltedSlopes(const Camera& reference, int x, int y);

// What a patch on one pixel's ray is scored by: the mean NCC over some targets. A target that cannot be compared counts
// as -1.
class PatchObjective {
 public:
  // `targets`: bit i for target i, at least one. References must outlive this.
  PatchObjective(const PatchScorer& scorer, const PatchScorer::Window& window, int x, int y, uint32_t targets);

  float operator()(const PatchPlane& plane) const;

  // Inverse depth by which the patch's image moves one pixel in the target where it moves fastest.
  float InverseDepthPerPixel(float w) const;

 private:
  const PatchScorer& scorer_;
  const PatchScorer::Window& window_;
  int x_;
  int y_;
  std::array<int, 32> targets_;
  size_t count_ = 0;
};

struct ScoredPlane {
  PatchPlane plane;
  float score = PatchScorer::kNoScore;
};

// The best of the planes with this relative slope whose image lies at most `reach` px (in the fastest target) from
// w's, in half-pixel steps.
ScoredPlane SearchDepth(const PatchObjective& objective, float w, const RelativeSlope& slope, int reach);

// Ascends the objective alternately in inverse depth and both slopes, stepping to the peak of the parabola through
// three scores; steps halve from round to round. `first_step`: of inverse depth, px in the fastest target; slopes'
// steps go with it. Never returns worse than it was given.
ScoredPlane RefinePlane(const PatchObjective& objective, const ScoredPlane& start, float first_step, int rounds);

}  // namespace meshwright
