// SPDX-License-Identifier: Apache-2.0
#include "worker/filtering/epipolar_offsets.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <optional>
#include <vector>

namespace meshwright {
namespace {

// Patches on every so many nodes of the lattice in both directions.
constexpr int kStride = 6;
// The photograph is looked at in so many parts in both directions: errors of the lens differ between them.
constexpr int kParts = 3;
constexpr int kReachPx = 3;
constexpr float kMinNcc = 0.7F;
// Fewer measurements in a part do not tell the cameras' error from noise.
constexpr size_t kMinMeasurements = 8;

// Where across the epipolar line the patch's image in the target is, px; none where no peak shows it.
std::optional<float> OffsetInTarget(const PatchScorer& scorer, const PatchScorer::Window& window, int x, int y,
                                    const PatchPlane& plane, int target) {
  const Eigen::Vector2f across = scorer.AcrossEpipolarLine(x, y, plane.w, target);
  std::array<float, 2 * kReachPx + 1> scores{};
  for (int k = -kReachPx; k <= kReachPx; ++k) {
    scores[static_cast<size_t>(k + kReachPx)] =
        scorer.Score(window, x, y, plane, target, static_cast<float>(k) * across);
  }
  const auto best = std::max_element(scores.begin(), scores.end());
  if (*best < kMinNcc || best == scores.begin() || best + 1 == scores.end()) return std::nullopt;
  const float before = *(best - 1);
  const float after = *(best + 1);
  const float curvature = before - 2 * *best + after;
  if (before == PatchScorer::kNoScore || after == PatchScorer::kNoScore || !(curvature < 0)) return std::nullopt;
  return static_cast<float>(best - scores.begin() - kReachPx) +
         std::clamp(0.5F * (before - after) / curvature, -0.5F, 0.5F);
}

float Median(std::vector<float>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Adds the square of what the measurements of one part have in common.
void AddPart(std::vector<float>& offsets, EpipolarOffsets& total) {
  if (offsets.size() < kMinMeasurements) return;
  const float common = Median(offsets);
  for (float& offset : offsets) offset = std::fabs(offset - common);
  // Variance of a median of so many normal values, from their median deviation.
  constexpr double kMedianVariance = 1.57 * 1.4826 * 1.4826;
  const double deviation = Median(offsets);
  const auto count = static_cast<double>(offsets.size());
  total.sum_of_squares += count * common * common - kMedianVariance * deviation * deviation;
  total.measurements += static_cast<int64_t>(offsets.size());
}

}  // namespace

EpipolarOffsets MeasureEpipolarOffsets(const PatchScorer& scorer, const SurfaceEstimate& surface, ThreadPool& pool) {
  const Lattice& lattice = surface.lattice;
  const int rows = (lattice.rows + kStride - 1) / kStride;
  const int columns = (lattice.columns + kStride - 1) / kStride;
  const auto targets = static_cast<size_t>(scorer.targets());
  std::vector<std::optional<float>> offsets(static_cast<size_t>(rows) * static_cast<size_t>(columns) * targets);
  pool.ParallelFor(rows, 1, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin * columns; i < end * columns; ++i) {
      const int column = static_cast<int>(i % columns) * kStride;
      const int row = static_cast<int>(i / columns) * kStride;
      const auto node = static_cast<size_t>(lattice.Index(column, row));
      if (!surface.HasPatch(static_cast<int64_t>(node))) continue;
      const int x = lattice.PixelX(column);
      const int y = lattice.PixelY(row);
      PatchScorer::Window window;
      scorer.MakeWindow(x, y, window);
      for (uint32_t rest = surface.sigma[node]; rest != 0; rest &= rest - 1) {
        const int target = std::countr_zero(rest);
        offsets[static_cast<size_t>(i) * targets + static_cast<size_t>(target)] =
            OffsetInTarget(scorer, window, x, y, surface.plane[node], target);
      }
    }
  });
  EpipolarOffsets total;
  std::vector<float> of_part;
  for (size_t target = 0; target < targets; ++target) {
    for (int part = 0; part < kParts * kParts; ++part) {
      of_part.clear();
      for (int row = part / kParts * rows / kParts; row < (part / kParts + 1) * rows / kParts; ++row) {
        for (int column = part % kParts * columns / kParts; column < (part % kParts + 1) * columns / kParts; ++column) {
          const auto& offset =
              offsets[(static_cast<size_t>(row) * static_cast<size_t>(columns) + static_cast<size_t>(column)) *
                          targets +
                      target];
          if (offset.has_value()) of_part.push_back(*offset);
        }
      }
      AddPart(of_part, total);
    }
  }
  return total;
}

}  // namespace meshwright
