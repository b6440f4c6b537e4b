// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>

#include <Eigen/Core>

namespace meshwright {

// Intrinsics as scene files give them: pinhole with skew and a distortion model, COLMAP's but for one. Pixel
// coordinates: the centre of the top-left pixel is (0.5, 0.5) (importers of other conventions shift the principal
// point).
struct Lens {
  enum class Model {
    kPinhole,                 // no distortion
    kRadial,                  // k1 k2                            (COLMAP SIMPLE_RADIAL, RADIAL)
    kOpenCv,                  // k1 k2 p1 p2                      (OPENCV)
    kFullOpenCv,              // k1 k2 p1 p2 k3 k4 k5 k6          (FULL_OPENCV)
    kOpenCvFisheye,           // k1 k2 k3 k4                      (OPENCV_FISHEYE)
    kRadialFisheye,           // k1 k2                            (SIMPLE_RADIAL_FISHEYE, RADIAL_FISHEYE)
    kFov,                     // omega                            (FOV)
    kThinPrismFisheye,        // k1 k2 p1 p2 k3 k4 sx1 sy1        (THIN_PRISM_FISHEYE)
    kBrown,                   // k1 k2 p1 p2 k3 k4                (Metashape: OpenCV with factors up to r^8)
    kRadTanThinPrismFisheye,  // k0 .. k5 p0 p1 s0 .. s3          (RAD_TAN_THIN_PRISM_FISHEYE, Project Aria)
    kDivision,                // k                                (SIMPLE_DIVISION, DIVISION; Fitzgibbon 2001)
    kEucm                     // alpha beta                       (EUCM; Khomutenko et al. 2016)
  };

  int width = 0;    // px
  int height = 0;   // px
  double fx = 0;    // px
  double fy = 0;    // px
  double cx = 0;    // px
  double cy = 0;    // px
  double skew = 0;  // px; K(0, 1)
  Model model = Model::kPinhole;
  std::array<double, 12> coefficients = {};  // in the order named at the model

  bool is_plain_pinhole() const { return model == Model::kPinhole && skew == 0; }

  // Distorted from undistorted coordinates on the plane z = 1.
  Eigen::Vector2d Distort(const Eigen::Vector2d& undistorted) const;
  // Pixel at which the lens images a point of the plane z = 1.
  Eigen::Vector2d PixelFromPlane(const Eigen::Vector2d& undistorted) const;
  // The inverse of PixelFromPlane (iterative where there is no closed form).
  Eigen::Vector2d PlaneFromPixel(const Eigen::Vector2d& pixel) const;
};

}  // namespace meshwright
