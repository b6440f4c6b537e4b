// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <absl/types/span.h>

#include "common/base/spooled_vector.h"

namespace meshwright {

// Points in boxes that share none of them: halved along their longest side until at most so many are left in each.
// Depends on the points and their order alone. Scene units, world frame.
class PointBlocks {
 public:
  struct Block {
    // Of the box: low <= x < high, without end outside.
    Eigen::Vector3d low = Eigen::Vector3d::Constant(-std::numeric_limits<double>::infinity());
    Eigen::Vector3d high = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
    Eigen::AlignedBox3d around_points = {};
    size_t first = 0;  // of Points()
    size_t last = 0;   // the one behind

    bool Contains(const Eigen::Vector3d& x) const {
      return (x.array() >= low.array()).all() && (x.array() < high.array()).all();
    }
    // The box around its points, grown by `share` of its longest side.
    Eigen::AlignedBox3d Grown(double share) const;
  };
  using PointAt = std::function<Eigen::Vector3d(int32_t point)>;

  // Points 0 .. count - 1; `at` is asked as long as the blocks are there. What grows with them is spooled beside
  // `spool_beside` (SpooledBytes).
  PointBlocks(int32_t count, PointAt at, size_t most_of_block, const std::string& spool_beside);

  const std::vector<Block>& blocks() const { return blocks_; }
  absl::Span<const int32_t> Points(const Block& block) const {
    return absl::MakeConstSpan(order_.data() + block.first, block.last - block.first);
  }
  const Eigen::AlignedBox3d& around_points() const { return around_points_; }
  // Of all blocks, ascending.
  std::vector<int32_t> PointsIn(const Eigen::AlignedBox3d& box) const;
  void Release() const { order_.Release(); }

 private:
  void Split(Block block, size_t most);

  PointAt at_;
  SpooledVector<int32_t> order_;  // block by block
  std::vector<Block> blocks_;
  Eigen::AlignedBox3d around_points_;
};

}  // namespace meshwright
