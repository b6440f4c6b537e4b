// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "common/scene/scene.h"

// What formats of cameras have in common.
namespace meshwright {

// OpenCV's distortion with factors up to r^8: radial 1 + k1 r^2 + k2 r^4 + k3 r^6 + k4 r^8, tangential p1 p2.
struct RadialTangential {
  double k1 = 0;
  double k2 = 0;
  double k3 = 0;
  double k4 = 0;
  double p1 = 0;
  double p2 = 0;
};

// Gives the lens the narrowest model that has these coefficients: a lens without distortion is a plain pinhole.
void SetDistortion(const RadialTangential& distortion, Lens* lens);

inline Rigid3 PoseFromCenter(const Eigen::Matrix3d& cam_from_world, const Eigen::Vector3d& center_in_world) {
  return {cam_from_world, -(cam_from_world * center_in_world)};
}

// Of a camera that looks down its -Z with Y up (OpenGL): the same pose with ours.
inline Eigen::Matrix3d FlipYAndZ(const Eigen::Matrix3d& rows) { return Eigen::Vector3d(1, -1, -1).asDiagonal() * rows; }

}  // namespace meshwright
