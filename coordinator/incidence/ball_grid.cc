// SPDX-License-Identifier: Apache-2.0
#include "coordinator/incidence/ball_grid.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace meshwright {
namespace {

// Radii below this share of the scene's extent are kept as if they had it, so that cells can be counted.
constexpr double kSmallestShareOfExtent = 1e-12;

}  // namespace

BallGrid::BallGrid(const std::vector<CameraProbes>& probes) : probes_(probes) {
  if (probes.empty()) return;
  Eigen::Vector3d low = probes.front().frustum_center_in_world;
  Eigen::Vector3d high = low;
  for (const CameraProbes& ball : probes) {
    low = low.cwiseMin(ball.frustum_center_in_world);
    high = high.cwiseMax(ball.frustum_center_in_world);
  }
  origin_in_world_ = low;
  const double smallest = std::max(kSmallestShareOfExtent * (high - low).norm(), 1e-300);
  std::map<int, std::vector<CameraIndex>> by_exponent;
  for (size_t i = 0; i < probes.size(); ++i) {
    const int exponent = std::ilogb(std::max(probes[i].frustum_radius, smallest)) + 1;
    by_exponent[exponent].push_back(static_cast<CameraIndex>(i));
  }
  level_of_.resize(probes.size());
  for (const auto& [exponent, cameras] : by_exponent) {
    Level level{.cell_size = std::ldexp(1.0, exponent)};
    for (const CameraIndex camera : cameras) {
      const auto i = static_cast<size_t>(camera);
      level_of_[i] = static_cast<int>(levels_.size());
      level.cells[CellOf(probes[i].frustum_center_in_world, level.cell_size)].push_back(camera);
    }
    levels_.push_back(std::move(level));
  }
}

BallGrid::Cell BallGrid::CellOf(const Eigen::Vector3d& x_in_world, double cell_size) const {
  Cell cell;
  for (int axis = 0; axis < 3; ++axis) {
    const double place = std::floor((x_in_world[axis] - origin_in_world_[axis]) / cell_size);
    cell[static_cast<size_t>(axis)] = static_cast<int64_t>(place);
  }
  return cell;
}

void BallGrid::FindMeeting(CameraIndex camera, std::vector<CameraIndex>& meeting) const {
  meeting.clear();
  const CameraProbes& ball = probes_[static_cast<size_t>(camera)];
  const int own_level = level_of_[static_cast<size_t>(camera)];
  for (auto l = static_cast<size_t>(own_level); l < levels_.size(); ++l) {
    const Level& level = levels_[l];
    // No ball of this level is larger than a cell, and this one is not either.
    const Eigen::Vector3d reach = Eigen::Vector3d::Constant(ball.frustum_radius + level.cell_size);
    const Cell low = CellOf(ball.frustum_center_in_world - reach, level.cell_size);
    const Cell high = CellOf(ball.frustum_center_in_world + reach, level.cell_size);
    for (int64_t x = low[0]; x <= high[0]; ++x) {
      for (int64_t y = low[1]; y <= high[1]; ++y) {
        for (int64_t z = low[2]; z <= high[2]; ++z) {
          const auto cell = level.cells.find({x, y, z});
          if (cell == level.cells.end()) continue;
          for (const CameraIndex other : cell->second) {
            if (static_cast<int>(l) == own_level && other <= camera) continue;
            if (FrustaMeet(ball, probes_[static_cast<size_t>(other)])) meeting.push_back(other);
          }
        }
      }
    }
  }
}

}  // namespace meshwright
