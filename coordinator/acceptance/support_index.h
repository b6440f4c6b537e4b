// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "common/surface/sparse_surface.h"

namespace meshwright {

// What one supporter's filtered surface says about points of another. Frames: the supporter camera's.
class SupportIndex {
 public:
  explicit SupportIndex(const SparseSurface& surface);

  const SparseSurface& surface() const { return surface_; }

  // Whether a patch centre lies within `radius` of the point. Inferred patches count for the like alone.
  bool HasPatchNear(const Eigen::Vector3d& x_in_cam, double radius, bool is_inferred) const;

  // Whether the supporter looks through the point: it has measured a surface more than `clearance` behind it on all
  // four rays around it.
  bool SeesThrough(const Eigen::Vector3d& x_in_cam, double clearance) const;

  // How far along `direction` from the point the supporter has measured the surface, in lengths of `direction`: by the
  // planes of its patches on the four rays around the point. Nothing when it has none there within `max_distance` (in
  // the same lengths), or the direction meets them at too flat an angle to tell.
  std::optional<double> DistanceAlong(const Eigen::Vector3d& x_in_cam, const Eigen::Vector3d& direction_in_cam,
                                      double max_distance) const;

 private:
  bool IsNear(int32_t patch, const Eigen::Vector3d& x_in_cam, double squared_radius, bool is_inferred) const;
  Eigen::Vector3d PointInCam(int32_t patch) const;

  const SparseSurface& surface_;
  const PatchFinder finder_;
  std::vector<double> ray_x_;  // per column: x / z of the node's ray
  std::vector<double> ray_y_;  // per row
};

}  // namespace meshwright
