// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace meshwright {

// Points of an image in square cells, to find those near a segment or near a place. Answers do not depend on anything
// but the points and their order.
class PixelIndex {
 public:
  // Points outside [0, width] x [0, height] count as lying in the nearest cell.
  PixelIndex(int width, int height, int cell_size, std::vector<Eigen::Vector2f> points);

  const Eigen::Vector2f& point(int32_t i) const { return points_[static_cast<size_t>(i)]; }

  // Replaces `found` by the points within `band` px of the segment's line and at most `band` px beyond its ends.
  void FindNearSegment(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double band,
                       std::vector<int32_t>& found) const;

  // The `count` points nearest to `place` within `max_distance` px, nearest first (ties: lower index first).
  std::vector<int32_t> FindNearest(const Eigen::Vector2f& place, int count, float max_distance) const;

 private:
  int CellOf(float coordinate, int cells) const;

  int cell_size_;
  int columns_;
  int rows_;
  std::vector<Eigen::Vector2f> points_;
  std::vector<int32_t> first_;  // of each cell in order_, and one past the last
  std::vector<int32_t> order_;  // point indices by cell
};

}  // namespace meshwright
