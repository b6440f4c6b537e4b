// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

namespace meshwright {

// Rigid motion x_in_b = rotation * x_in_a + translation, named b_from_a where it is used.
struct Rigid3 {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator*(const Eigen::Vector3d& x_in_a) const { return rotation * x_in_a + translation; }
};

// c_from_a = c_from_b * b_from_a.
inline Rigid3 operator*(const Rigid3& c_from_b, const Rigid3& b_from_a) {
  return {c_from_b.rotation * b_from_a.rotation, c_from_b.rotation * b_from_a.translation + c_from_b.translation};
}

inline Rigid3 Inverse(const Rigid3& b_from_a) {
  return {b_from_a.rotation.transpose(), -(b_from_a.rotation.transpose() * b_from_a.translation)};
}

}  // namespace meshwright
