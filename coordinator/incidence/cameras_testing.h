// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "common/geometry/camera.h"

namespace meshwright {

// For the tests of this room: a camera of 640 x 480 px, field of view about 65 x 51 degrees, looking at a point.
inline Camera CameraLookingAt(const Eigen::Vector3d& center_in_world, const Eigen::Vector3d& target_in_world,
                              double focal = 500) {
  Camera camera{.width = 640, .height = 480, .fx = focal, .fy = focal, .cx = 320, .cy = 240};
  const Eigen::Vector3d forward = (target_in_world - center_in_world).normalized();
  const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
  camera.cam_from_world.rotation.row(0) = right.transpose();
  camera.cam_from_world.rotation.row(1) = forward.cross(right).transpose();
  camera.cam_from_world.rotation.row(2) = forward.transpose();
  camera.cam_from_world.translation = -(camera.cam_from_world.rotation * center_in_world);
  return camera;
}

}  // namespace meshwright
