// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "common/geometry/camera.h"

namespace meshwright {

// Where a target sees the ray through a pixel of the reference: the image of the ray's point with inverse depth w is
// the homogeneous pixel far + w * step, for w in [min_w, max_w].
struct EpipolarSegment {
  Eigen::Vector3d far = Eigen::Vector3d::Zero();
  Eigen::Vector3d step = Eigen::Vector3d::Zero();
  double min_w = 1;  // inverse depth in the reference camera, 1 / scene units
  double max_w = 0;

  bool empty() const { return !(min_w <= max_w); }
  bool Contains(double w) const { return w >= min_w && w <= max_w; }
  Eigen::Vector2d Pixel(double w) const { return (far + w * step).hnormalized(); }
  // Inverse depth at which the segment passes `pixel`, which lies near it: where their coordinates along the segment's
  // longer side agree. The segment must not be empty.
  double InverseDepthBeside(const Eigen::Vector2d& pixel) const;
};

// The epipolar geometry of a pair, with the apical angle bound on both sides (section 3.5, Jancosek et al. 2009): the
// angle at the point between the rays to both cameras falls as the point moves away.
class EpipolarGeometry {
 public:
  // Angles in radians, 0 < min_apical_angle < max_apical_angle < pi.
  EpipolarGeometry(const Camera& reference, const Camera& target, double min_apical_angle, double max_apical_angle);

  // The part of the ray through reference pixel (x, y) with inverse depth in [min_w, max_w], 0 < min_w, that lies in
  // front of the target, projects into its image, and is seen under an apical angle within the bounds.
  EpipolarSegment SegmentOf(double x, double y, double min_w, double max_w) const;

 private:
  Camera reference_;
  double target_width_;                    // px
  double target_height_;                   // px
  Eigen::Matrix3d target_pixel_from_ray_;  // K_t R
  Eigen::Vector3d target_pixel_step_;      // K_t t
  Eigen::Vector3d target_center_in_ref_;   // scene units
  double cot_min_angle_;
  double cot_max_angle_;
};

}  // namespace meshwright
