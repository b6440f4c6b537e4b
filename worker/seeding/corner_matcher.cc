// SPDX-License-Identifier: Apache-2.0
#include "worker/seeding/corner_matcher.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>
#include <utility>

#include <Eigen/Core>

namespace meshwright {
namespace {

constexpr int kCellSize = 16;        // px, of the indices of corners
constexpr double kEpipolarBand = 2;  // px: both corners are found to the pixel only
// NCC of a facing window below which a match is not looked at any further, and what its best slope must reach.
constexpr float kMinFirstNcc = 0.3F;
constexpr float kMinPairNcc = 0.5F;
// A window that matches so well needs no other slope.
constexpr float kGoodPairNcc = 0.8F;
// Matches in different targets whose depths differ by less than this in a target's image are one hypothesis.
constexpr float kSameDepthPx = 2;
constexpr size_t kMaxMatches = 64;  // of a corner, the best

}  // namespace

CornerMatcher::CornerMatcher(const SeedFitter& fitter, double min_w, double max_w, ThreadPool& pool)
    : fitter_(fitter), scorer_(fitter.scorer()), min_w_(min_w), max_w_(max_w) {
  for (int i = 0; i < scorer_.targets(); ++i) {
    const SamplingImage& image = *scorer_.target(i).grey;
    std::vector<Eigen::Vector2f> pixels;
    for (const Corner& corner : DetectHarrisCorners(image, {}, pool)) {
      pixels.emplace_back(static_cast<float>(corner.x) + 0.5F, static_cast<float>(corner.y) + 0.5F);
    }
    target_corners_.emplace_back(image.width(), image.height(), kCellSize, std::move(pixels));
  }
}

std::vector<CornerHypothesis> CornerMatcher::Match(const Corner& corner, const PatchScorer::Window& window,
                                                   double min_w, const std::optional<RelativeSlope>& prior) const {
  return Group(corner, FindMatches(corner, window, min_w, prior));
}

std::vector<CornerMatch> CornerMatcher::FindMatches(const Corner& corner, const PatchScorer::Window& window,
                                                    double min_w, const std::optional<RelativeSlope>& prior) const {
  const Camera& reference = scorer_.reference();
  const RelativeSlope facing = FacingSlope(reference, corner.x, corner.y);
  const std::array<RelativeSlope, 4> tilted = TiltedSlopes(reference, corner.x, corner.y);

  std::vector<CornerMatch> matches;
  std::vector<int32_t> found;
  for (int target = 0; target < scorer_.targets(); ++target) {
    const EpipolarSegment segment =
        fitter_.epipolar(target).SegmentOf(corner.x + 0.5, corner.y + 0.5, std::max(min_w, min_w_), max_w_);
    if (segment.empty()) continue;
    const PixelIndex& corners = target_corners_[static_cast<size_t>(target)];
    corners.FindNearSegment(segment.Pixel(segment.min_w), segment.Pixel(segment.max_w), kEpipolarBand, found);
    for (const int32_t i : found) {
      const auto w = static_cast<float>(
          std::clamp(segment.InverseDepthBeside(corners.point(i).cast<double>()), segment.min_w, segment.max_w));
      CornerMatch match{{}, PatchScorer::kNoScore, target};
      const auto propose = [&](const RelativeSlope& slope) {
        const PatchPlane plane = PlaneWithSlope(w, slope);
        const float ncc = scorer_.Score(window, corner.x, corner.y, plane, target);
        if (ncc > match.ncc) {
          match.plane = plane;
          match.ncc = ncc;
        }
      };
      propose(facing);
      if (prior && match.ncc < kGoodPairNcc) propose(*prior);
      if (match.ncc < kMinFirstNcc) continue;
      if (!prior && match.ncc < kGoodPairNcc) {
        for (const RelativeSlope& slope : tilted) propose(slope);
      }
      if (match.ncc >= kMinPairNcc) matches.push_back(match);
    }
  }
  return matches;
}

std::vector<CornerHypothesis> CornerMatcher::Group(const Corner& corner, std::vector<CornerMatch> matches) const {
  std::sort(matches.begin(), matches.end(), [](const CornerMatch& a, const CornerMatch& b) {
    return std::tie(b.ncc, a.target, a.plane.w) < std::tie(a.ncc, b.target, b.plane.w);
  });
  if (matches.size() > kMaxMatches) matches.resize(kMaxMatches);
  std::vector<CornerHypothesis> hypotheses;
  std::vector<bool> taken(matches.size());
  for (size_t i = 0; i < matches.size(); ++i) {
    if (taken[i]) continue;
    CornerHypothesis hypothesis{matches[i], 0};
    uint32_t targets = 0;
    for (size_t k = i; k < matches.size(); ++k) {
      if (taken[k]) continue;
      const float px_per_w = scorer_.PixelsPerInverseDepth(corner.x, corner.y, matches[i].plane.w, matches[k].target);
      if (!(std::abs(matches[k].plane.w - matches[i].plane.w) * px_per_w <= kSameDepthPx)) continue;
      taken[k] = true;
      const uint32_t bit = 1U << matches[k].target;
      if ((targets & bit) == 0) hypothesis.support += matches[k].ncc;
      targets |= bit;
    }
    hypotheses.push_back(hypothesis);
  }
  std::stable_sort(hypotheses.begin(), hypotheses.end(),
                   [](const CornerHypothesis& a, const CornerHypothesis& b) { return a.support > b.support; });
  return hypotheses;
}

}  // namespace meshwright
