// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "common/geometry/rigid3.h"

namespace meshwright {

// A pinhole camera without distortion or skew: what the method works with, after undistortion. Camera frame: X right,
// Y down, Z forward; depth is z, not the length of the ray. Pixel coordinates: the centre of the top-left pixel is
// (0.5, 0.5), so the image covers [0, width] x [0, height].
struct Camera {
  int width = 0;   // px
  int height = 0;  // px
  double fx = 0;   // px
  double fy = 0;   // px
  double cx = 0;   // px
  double cy = 0;   // px
  Rigid3 cam_from_world;

  double focal() const { return 0.5 * (fx + fy); }
  Eigen::Vector3d center_in_world() const {
    return -(cam_from_world.rotation.transpose() * cam_from_world.translation);
  }
  Eigen::Vector3d viewing_direction_in_world() const { return cam_from_world.rotation.row(2).transpose(); }

  Eigen::Matrix3d K() const {
    Eigen::Matrix3d k;
    k << fx, 0, cx, 0, fy, cy, 0, 0, 1;
    return k;
  }

  // The point with z = 1 on the ray through pixel (x, y), in the camera's frame.
  Eigen::Vector3d RayInCam(double x, double y) const { return {(x - cx) / fx, (y - cy) / fy, 1.0}; }

  // Pixel of a point in the camera's frame; its z must not be 0.
  Eigen::Vector2d ProjectFromCam(const Eigen::Vector3d& x_in_cam) const {
    return {fx * x_in_cam.x() / x_in_cam.z() + cx, fy * x_in_cam.y() / x_in_cam.z() + cy};
  }

  Eigen::Vector3d CamFromWorld(const Eigen::Vector3d& x_in_world) const { return cam_from_world * x_in_world; }

  // The point at depth z (> 0, scene units) seen at pixel (x, y).
  Eigen::Vector3d BackProject(double x, double y, double z) const {
    const Eigen::Vector3d x_in_cam = z * RayInCam(x, y);
    return cam_from_world.rotation.transpose() * (x_in_cam - cam_from_world.translation);
  }

  // Whether pixel coordinates lie in the image, at least `margin` pixels from its border.
  bool Contains(const Eigen::Vector2d& pixel, double margin = 0) const {
    return pixel.x() >= margin && pixel.y() >= margin && pixel.x() <= width - margin && pixel.y() <= height - margin;
  }
};

}  // namespace meshwright
