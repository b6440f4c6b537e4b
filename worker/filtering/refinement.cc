// SPDX-License-Identifier: Apache-2.0
#include "worker/filtering/refinement.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <vector>

#include "common/base/out_of_range.h"
#include "worker/filtering/smoothing.h"

namespace meshwright {
namespace {

// Rows of the lattice per piece of work.
constexpr int kRowsPerPiece = 4;
constexpr float kMinStepGain = 1e-6F;
// Of a refined depth, pixel footprints; and of one that could not be refined.
constexpr float kMinUncertainty = 0.02F;
constexpr float kMaxUncertainty = 4;
constexpr float kUnrefinedUncertainty = 1;

// The targets that may vote, and their mean score.
struct Voters {
  uint32_t sigma = 0;
  float quality = 0;
};

// Sigma anew: every target may vote that agrees, an occluded view does not.
Voters SelectViews(const PatchScorer& scorer, const PatchScorer::Window& window, int x, int y, const PatchPlane& plane,
                   const RefinementOptions& options) {
  std::array<float, 32> scores{};
  float best = -1;
  for (int target = 0; target < scorer.targets(); ++target) {
    scores[static_cast<size_t>(target)] = scorer.Score(window, x, y, plane, target);
    best = std::max(best, scores[static_cast<size_t>(target)]);
  }
  const float threshold =
      std::max(static_cast<float>(options.min_view_quality), best - static_cast<float>(options.max_view_deficit));
  Voters voters;
  int count = 0;
  for (int target = 0; target < scorer.targets(); ++target) {
    if (scores[static_cast<size_t>(target)] < threshold) continue;
    voters.sigma |= uint32_t{1} << target;
    voters.quality += scores[static_cast<size_t>(target)];
    ++count;
  }
  if (count > 0) voters.quality /= static_cast<float>(count);
  return voters;
}

// Inverse depth that moves the patch by one pixel in the target of Sigma where it moves most.
float InverseDepthPerPixel(const PatchScorer& scorer, int x, int y, const PatchPlane& plane, uint32_t sigma) {
  float fastest = 0;
  for (uint32_t rest = sigma; rest != 0; rest &= rest - 1) {
    fastest = std::max(fastest, scorer.PixelsPerInverseDepth(x, y, plane.w, __builtin_ctz(rest)));
  }
  return fastest > 0 ? 1.0F / fastest : 0.0F;
}

}  // namespace

absl::Status RefinementOptions::Validate() const {
  if (rounds < 0 || rounds > 8) return OutOfRange("refinement.rounds", rounds, "0..8");
  if (window_radius < 1 || window_radius > 7) return OutOfRange("refinement.window_radius", window_radius, "1..7 px");
  if (smoothing_radius_steps < 0 || smoothing_radius_steps > 8) {
    return OutOfRange("refinement.smoothing_radius_steps", smoothing_radius_steps, "0..8");
  }
  if (!(max_uncertainty_px > 0)) return OutOfRange("refinement.max_uncertainty_px", max_uncertainty_px, "> 0");
  if (!(first_step_px > 0)) return OutOfRange("refinement.first_step_px", first_step_px, "> 0");
  if (slope_radius_steps < 1 || slope_radius_steps > 8) {
    return OutOfRange("refinement.slope_radius_steps", slope_radius_steps, "1..8");
  }
  return absl::OkStatus();
}

namespace {

// Standard deviation of a depth found as the peak of photo-consistency, in the units of the step between scores: noise
// that lowers the peak to `quality` moves it the more the flatter it is.
float PeakUncertainty(float quality, float curvature) {
  constexpr float kIndependentPixels = 20;
  const float q = std::clamp(quality, 0.05F, 0.999F);
  return std::sqrt((1 - q) / (q * std::max(-curvature, 1e-4F) * kIndependentPixels));
}

// One step of depth at one node: a parabola through three scores. `uncertainty` is in pixel footprints.
int64_t RefineDepth(const PatchScorer& scorer, const RefinementOptions& options, float step_px, int64_t node,
                    SurfaceEstimate& surface, float& uncertainty) {
  const auto i = static_cast<size_t>(node);
  const int x = surface.lattice.PixelX(static_cast<int>(node % surface.lattice.columns));
  const int y = surface.lattice.PixelY(static_cast<int>(node / surface.lattice.columns));
  PatchPlane& plane = surface.plane[i];
  PatchScorer::Window window;
  scorer.MakeWindow(x, y, window);
  if (!window.usable) return 0;
  const auto [sigma, q] = SelectViews(scorer, window, x, y, plane, options);
  if (sigma == 0) return 1;
  surface.sigma[i] = sigma;
  surface.quality[i] = q;
  const float step = step_px * InverseDepthPerPixel(scorer, x, y, plane, sigma);
  const float nearer = scorer.MeanScore(window, x, y, {plane.w + step, plane.gx, plane.gy}, sigma);
  const float further = scorer.MeanScore(window, x, y, {plane.w - step, plane.gx, plane.gy}, sigma);
  if (nearer == PatchScorer::kNoScore || further == PatchScorer::kNoScore) return 3;
  const float curvature = nearer - 2 * q + further;
  float offset = 0;
  if (curvature < -kMinStepGain) {
    offset = std::clamp(0.5F * (further - nearer) / curvature, -1.0F, 1.0F);
  } else {
    offset = nearer > further ? 1.0F : -1.0F;
  }
  plane.w += offset * step;
  surface.quality[i] = std::max({q, nearer, further});
  const float footprint = plane.w / static_cast<float>(scorer.reference().focal());  // in inverse depth
  uncertainty =
      std::clamp(PeakUncertainty(surface.quality[i], curvature) * step / footprint, kMinUncertainty, kMaxUncertainty);
  return 3;
}

// Slopes by least squares from linked neighbours' inverse depths.
PatchPlane FitToNeighbours(const SurfaceEstimate& surface, const std::vector<PatchPlane>& planes, int column, int row,
                           int radius, float max_difference) {
  const Lattice& lattice = surface.lattice;
  const PatchPlane& own = planes[static_cast<size_t>(lattice.Index(column, row))];
  const auto step = static_cast<float>(lattice.step);
  float sxx = 1;
  float sxy = 0;
  float syy = 1;
  float sx = own.gx * step;
  float sy = own.gy * step;
  for (int dy = -radius; dy <= radius; ++dy) {
    for (int dx = -radius; dx <= radius; ++dx) {
      if ((dx == 0 && dy == 0) || !lattice.Contains(column + dx, row + dy)) continue;
      const PatchPlane& other = planes[static_cast<size_t>(lattice.Index(column + dx, row + dy))];
      if (!(other.w > 0)) continue;
      const float predicted = own.w + step * (own.gx * static_cast<float>(dx) + own.gy * static_cast<float>(dy));
      if (std::fabs(other.w - predicted) > max_difference) continue;
      const float difference = other.w - own.w;
      const auto fx = static_cast<float>(dx);
      const auto fy = static_cast<float>(dy);
      sxx += fx * fx;
      sxy += fx * fy;
      syy += fy * fy;
      sx += fx * difference;
      sy += fy * difference;
    }
  }
  const float scale = 1.0F / ((sxx * syy - sxy * sxy) * step);
  return {own.w, (syy * sx - sxy * sy) * scale, (sxx * sy - sxy * sx) * scale};
}

void DropUncertain(const std::vector<float>& uncertainty, float most, SurfaceEstimate& surface) {
  const Lattice& lattice = surface.lattice;
  const auto columns = static_cast<size_t>(lattice.columns);
  for (size_t node = 0; node < uncertainty.size(); ++node) {
    if (uncertainty[node] <= most) continue;
    surface.plane[node] = {};
    surface.quality[node] = 0;
    surface.sigma[node] = 0;
    surface.links[node] = 0;
    if (node % columns > 0) surface.links[node - 1] &= static_cast<uint8_t>(~PatchLattice::kLinkRight);
    if (node >= columns) surface.links[node - columns] &= static_cast<uint8_t>(~PatchLattice::kLinkDown);
  }
}

}  // namespace

int64_t RefineSurface(const PatchScorer& scorer, const RefinementOptions& options, SurfaceEstimate& surface,
                      ThreadPool& pool) {
  std::atomic<int64_t> scored{0};
  const Lattice& lattice = surface.lattice;
  const auto over_rows = [&](const auto& body) {
    pool.ParallelFor(lattice.rows, kRowsPerPiece, [&](int64_t begin, int64_t end) {
      for (int64_t row = begin; row < end; ++row) {
        for (int column = 0; column < lattice.columns; ++column) {
          if (surface.HasPatch(lattice.Index(column, static_cast<int>(row)))) body(column, static_cast<int>(row));
        }
      }
    });
  };
  std::vector<float> uncertainty(surface.plane.size(), kUnrefinedUncertainty);
  auto step_px = static_cast<float>(options.first_step_px);
  for (int round = 0; round < options.rounds; ++round) {
    over_rows([&](int column, int row) {
      const int64_t node = lattice.Index(column, row);
      scored += RefineDepth(scorer, options, step_px, node, surface, uncertainty[static_cast<size_t>(node)]);
    });
    const std::vector<PatchPlane> refined = surface.plane;
    over_rows([&](int column, int row) {
      const auto node = static_cast<size_t>(lattice.Index(column, row));
      const float reach =
          3 * refined[node].w * static_cast<float>(lattice.step) / static_cast<float>(scorer.reference().focal());
      surface.plane[node] = FitToNeighbours(surface, refined, column, row, options.slope_radius_steps, reach);
    });
    step_px *= 0.5F;
  }
  if (options.rounds > 0 && options.smoothing_radius_steps > 0) {
    SmoothDepth(uncertainty, scorer.reference().focal(), options.smoothing_radius_steps, surface, pool);
  }
  DropUncertain(uncertainty, static_cast<float>(options.max_uncertainty_px), surface);
  return scored;
}

}  // namespace meshwright
