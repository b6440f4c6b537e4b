// SPDX-License-Identifier: Apache-2.0
#include "worker/seeding/epipolar.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

namespace meshwright {
namespace {

// A point this many times closer to the target than to the reference looks too different to be compared.
constexpr double kMinDepthRatio = 0.1;
// Nearest point of a ray that has no other bound, in baselines: rays that leave almost away from the target.
constexpr double kMinDistanceInBaselines = 0.25;

// Keeps of [min_w, max_w] what satisfies constant + w * slope >= 0.
void Clip(double constant, double slope, EpipolarSegment& segment) {
  if (slope > 0) {
    segment.min_w = std::max(segment.min_w, -constant / slope);
  } else if (slope < 0) {
    segment.max_w = std::min(segment.max_w, -constant / slope);
  } else if (constant < 0) {
    segment.max_w = segment.min_w - 1;
  }
}

}  // namespace

double EpipolarSegment::InverseDepthBeside(const Eigen::Vector2d& pixel) const {
  const Eigen::Vector2d extent = (Pixel(max_w) - Pixel(min_w)).cwiseAbs();
  const int axis = extent.x() >= extent.y() ? 0 : 1;
  // (far + w step)[axis] = pixel[axis] * (far + w step).z
  const double denominator = step[axis] - pixel[axis] * step.z();
  if (denominator == 0) return min_w;
  return (pixel[axis] * far.z() - far[axis]) / denominator;
}

EpipolarGeometry::EpipolarGeometry(const Camera& reference, const Camera& target, double min_apical_angle,
                                   double max_apical_angle)
    : reference_(reference),
      target_width_(target.width),
      target_height_(target.height),
      cot_min_angle_(std::cos(min_apical_angle) / std::sin(min_apical_angle)),
      cot_max_angle_(std::cos(max_apical_angle) / std::sin(max_apical_angle)) {
  const Rigid3 target_from_ref = target.cam_from_world * Inverse(reference.cam_from_world);
  target_pixel_from_ray_ = target.K() * target_from_ref.rotation;
  target_pixel_step_ = target.K() * target_from_ref.translation;
  target_center_in_ref_ = Inverse(target_from_ref).translation;
}

EpipolarSegment EpipolarGeometry::SegmentOf(double x, double y, double min_w, double max_w) const {
  const Eigen::Vector3d ray = reference_.RayInCam(x, y);
  EpipolarSegment segment{target_pixel_from_ray_ * ray, target_pixel_step_, min_w, max_w};

  // Law of sines in the triangle of both centres and the point: with phi the angle at the reference and alpha at the
  // point, the point's distance is B sin(phi + alpha) / sin(alpha) = B (sin(phi) cot(alpha) + cos(phi)).
  const double ray_length = ray.norm();
  const double along = target_center_in_ref_.dot(ray) / ray_length;            // B cos(phi)
  const double across = target_center_in_ref_.cross(ray).norm() / ray_length;  // B sin(phi)
  const double farthest = across * cot_min_angle_ + along;
  const double nearest = std::max(across * cot_max_angle_ + along, kMinDistanceInBaselines * std::hypot(along, across));
  if (!(farthest > 0) || !(nearest > 0)) {
    segment.max_w = segment.min_w - 1;
    return segment;
  }
  segment.min_w = std::max(segment.min_w, ray_length / farthest);
  segment.max_w = std::min(segment.max_w, ray_length / nearest);

  // far.z + w step.z is the ratio of the depths in both cameras; where it is positive, the image's borders are linear
  // in w too.
  const Eigen::Vector3d& far = segment.far;
  const Eigen::Vector3d& step = segment.step;
  Clip(far.z() - kMinDepthRatio, step.z(), segment);
  Clip(far.x(), step.x(), segment);
  Clip(far.y(), step.y(), segment);
  Clip(target_width_ * far.z() - far.x(), target_width_ * step.z() - step.x(), segment);
  Clip(target_height_ * far.z() - far.y(), target_height_ * step.z() - step.y(), segment);
  return segment;
}

}  // namespace meshwright
