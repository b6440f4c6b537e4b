// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>
#include <absl/container/flat_hash_map.h>

#include "common/base/ids.h"
#include "coordinator/incidence/camera_probes.h"

namespace meshwright {

// Finds the balls around frusta that meet (FrustaMeet) without looking at all pairs: each ball is kept at its centre in
// a grid whose cells are at least its radius wide, a grid for each power of two. Of two balls the smaller one (the
// first one among those of one grid) finds the larger one, within two cells around it. Time and memory follow the
// number of balls and of pairs that come near each other.
class BallGrid {
 public:
  // `probes` outlive the grid; centres and radii are finite.
  explicit BallGrid(const std::vector<CameraProbes>& probes);

  // Cameras whose balls meet that of `camera` and that do not find it themselves: over all cameras each pair once.
  // In no particular order.
  void FindMeeting(CameraIndex camera, std::vector<CameraIndex>& meeting) const;

 private:
  using Cell = std::array<int64_t, 3>;
  struct Level {
    double cell_size = 0;  // scene units
    absl::flat_hash_map<Cell, std::vector<CameraIndex>> cells;
  };

  Cell CellOf(const Eigen::Vector3d& x_in_world, double cell_size) const;

  const std::vector<CameraProbes>& probes_;
  Eigen::Vector3d origin_in_world_ = Eigen::Vector3d::Zero();
  std::vector<Level> levels_;  // by growing cells
  std::vector<int> level_of_;  // of each camera
};

}  // namespace meshwright
