// SPDX-License-Identifier: Apache-2.0
#include "worker/seeding/pixel_index.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/base/check.h"

namespace meshwright {

PixelIndex::PixelIndex(int width, int height, int cell_size, std::vector<Eigen::Vector2f> points)
    : cell_size_(cell_size),
      columns_(std::max(1, (width + cell_size - 1) / cell_size)),
      rows_(std::max(1, (height + cell_size - 1) / cell_size)),
      points_(std::move(points)) {
  MW_CHECK(cell_size > 0);
  const auto cell_of = [this](const Eigen::Vector2f& point) {
    return static_cast<size_t>(CellOf(point.y(), rows_)) * static_cast<size_t>(columns_) +
           static_cast<size_t>(CellOf(point.x(), columns_));
  };
  first_.assign(static_cast<size_t>(columns_) * static_cast<size_t>(rows_) + 1, 0);
  for (const Eigen::Vector2f& point : points_) ++first_[cell_of(point) + 1];
  for (size_t cell = 1; cell < first_.size(); ++cell) first_[cell] += first_[cell - 1];
  order_.resize(points_.size());
  std::vector<int32_t> next(first_.begin(), first_.end() - 1);
  for (size_t i = 0; i < points_.size(); ++i) {
    order_[static_cast<size_t>(next[cell_of(points_[i])]++)] = static_cast<int32_t>(i);
  }
}

int PixelIndex::CellOf(float coordinate, int cells) const {
  // Truncation is rounding down here: negative cells become 0 either way.
  const float cell = coordinate / static_cast<float>(cell_size_);
  return static_cast<int>(std::clamp(cell, 0.0F, static_cast<float>(cells - 1)));
}

void PixelIndex::FindNearSegment(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double band,
                                 std::vector<int32_t>& found) const {
  found.clear();
  const Eigen::Vector2d along = to - from;
  const double length = along.norm();
  const Eigen::Vector2d unit = length > 0 ? Eigen::Vector2d(along / length) : Eigen::Vector2d(1, 0);
  // Walk slabs of cells across the longer side; within a slab only the cells that the band touches.
  const int major = std::abs(unit.x()) >= std::abs(unit.y()) ? 0 : 1;
  const int minor = 1 - major;
  const int major_cells = major == 0 ? columns_ : rows_;
  const int minor_cells = major == 0 ? rows_ : columns_;
  const double slope = unit[minor] / unit[major];
  // The band's half-width measured along the minor axis, and how far its square ends reach along the major one; a
  // little more for rounding.
  const double reach = band / std::abs(unit[major]) + 1e-3;
  const double end_reach = band * (std::abs(unit[major]) + std::abs(unit[minor])) + 1e-3;
  const double low = std::min(from[major], to[major]) - end_reach;
  const double high = std::max(from[major], to[major]) + end_reach;
  const int first_slab = CellOf(static_cast<float>(low), major_cells);
  const int last_slab = CellOf(static_cast<float>(high), major_cells);
  for (int slab = first_slab; slab <= last_slab; ++slab) {
    // Border cells also hold what lies outside the image.
    const double begin = slab == 0 ? low : std::max(low, static_cast<double>(slab) * cell_size_);
    const double end = slab == major_cells - 1 ? high : std::min(high, static_cast<double>(slab + 1) * cell_size_);
    const double at_begin = from[minor] + slope * (begin - from[major]);
    const double at_end = from[minor] + slope * (end - from[major]);
    const int first = CellOf(static_cast<float>(std::min(at_begin, at_end) - reach), minor_cells);
    const int last = CellOf(static_cast<float>(std::max(at_begin, at_end) + reach), minor_cells);
    for (int other = first; other <= last; ++other) {
      const auto cell = static_cast<size_t>(major == 0 ? other : slab) * static_cast<size_t>(columns_) +
                        static_cast<size_t>(major == 0 ? slab : other);
      for (int32_t k = first_[cell]; k < first_[cell + 1]; ++k) {
        const int32_t i = order_[static_cast<size_t>(k)];
        const Eigen::Vector2d offset = point(i).cast<double>() - from;
        const double across = offset.x() * unit.y() - offset.y() * unit.x();
        const double forward = offset.dot(unit);
        if (std::abs(across) <= band && forward >= -band && forward <= length + band) found.push_back(i);
      }
    }
  }
}

std::vector<int32_t> PixelIndex::FindNearest(const Eigen::Vector2f& place, int count, float max_distance) const {
  const int column = CellOf(place.x(), columns_);
  const int row = CellOf(place.y(), rows_);
  const int max_ring = static_cast<int>(std::ceil(max_distance / static_cast<float>(cell_size_)));
  std::vector<std::pair<float, int32_t>> found;
  for (int ring = 0; ring <= max_ring; ++ring) {
    // Cells of this ring and beyond are at least so far away.
    const auto unseen = static_cast<float>(std::max(0, ring - 1) * cell_size_);
    const auto settled = std::count_if(found.begin(), found.end(),
                                       [&](const auto& candidate) { return candidate.first <= unseen * unseen; });
    if (settled >= count) break;
    for (int r = std::max(0, row - ring); r <= std::min(rows_ - 1, row + ring); ++r) {
      const bool whole_row = r == row - ring || r == row + ring;
      for (int c = column - ring; c <= column + ring; c += whole_row || ring == 0 ? 1 : 2 * ring) {
        if (c < 0 || c >= columns_) continue;
        const auto cell = static_cast<size_t>(r) * static_cast<size_t>(columns_) + static_cast<size_t>(c);
        for (int32_t k = first_[cell]; k < first_[cell + 1]; ++k) {
          const int32_t i = order_[static_cast<size_t>(k)];
          const float distance_squared = (point(i) - place).squaredNorm();
          if (distance_squared <= max_distance * max_distance) found.emplace_back(distance_squared, i);
        }
      }
    }
  }
  const auto kept = std::min(found.size(), static_cast<size_t>(std::max(count, 0)));
  std::partial_sort(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(kept), found.end());
  std::vector<int32_t> nearest;
  for (size_t i = 0; i < kept; ++i) nearest.push_back(found[i].second);
  return nearest;
}

}  // namespace meshwright
