// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/point_blocks.h"

#include <algorithm>
#include <utility>

namespace meshwright {

Eigen::AlignedBox3d PointBlocks::Block::Grown(double share) const {
  Eigen::AlignedBox3d box = around_points;
  const Eigen::Vector3d margin = Eigen::Vector3d::Constant(share * box.sizes().maxCoeff());
  box.extend(box.min() - margin);
  box.extend(box.max() + margin);
  return box;
}

PointBlocks::PointBlocks(int32_t count, PointAt at, size_t most_of_block, const std::string& spool_beside)
    : at_(std::move(at)), order_(spool_beside) {
  for (int32_t i = 0; i < count; ++i) order_.push_back(i);
  if (count > 0) Split({.first = 0, .last = static_cast<size_t>(count)}, most_of_block);
}

void PointBlocks::Split(Block block, size_t most) {
  int32_t* const first = order_.data() + block.first;
  int32_t* const last = order_.data() + block.last;
  for (const int32_t* i = first; i != last; ++i) block.around_points.extend(at_(*i));
  if (block.last - block.first > most) {
    Eigen::Index axis = 0;
    block.around_points.sizes().maxCoeff(&axis);
    int32_t* const middle = first + (last - first) / 2;
    std::nth_element(first, middle, last,
                     [&](int32_t i, int32_t j) { return std::pair(at_(i)[axis], i) < std::pair(at_(j)[axis], j); });
    const double border = at_(*middle)[axis];
    const int32_t* const split = std::partition(first, last, [&](int32_t i) { return at_(i)[axis] < border; });
    if (split != first) {
      Block below = {.low = block.low, .high = block.high, .first = block.first, .last = block.last};
      Block above = below;
      below.high[axis] = border;
      above.low[axis] = border;
      below.last = block.first + static_cast<size_t>(split - first);
      above.first = below.last;
      Split(below, most);
      Split(above, most);
      return;
    }
  }
  // The same for every block, however it came about.
  std::sort(first, last);
  blocks_.push_back(block);
  around_points_.extend(block.around_points);
}

std::vector<int32_t> PointBlocks::PointsIn(const Eigen::AlignedBox3d& box) const {
  std::vector<int32_t> found;
  for (const Block& block : blocks_) {
    if (!box.intersects(block.around_points)) continue;
    for (const int32_t i : Points(block)) {
      if (box.contains(at_(i))) found.push_back(i);
    }
  }
  std::ranges::sort(found);
  return found;
}

}  // namespace meshwright
