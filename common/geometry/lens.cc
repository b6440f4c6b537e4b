// SPDX-License-Identifier: Apache-2.0
#include "common/geometry/lens.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

namespace meshwright {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;

// Directions at 90 degrees from the optical axis or beyond meet the plane z = 1 nowhere: the inverse stops short of
// them, at a point of the plane about 1e6 away.
constexpr double kLargestAngle = M_PI / 2 - 1e-6;  // rad

bool IsFisheye(Lens::Model model) {
  return model == Lens::Model::kOpenCvFisheye || model == Lens::Model::kRadialFisheye ||
         model == Lens::Model::kThinPrismFisheye || model == Lens::Model::kRadTanThinPrismFisheye;
}

// Fisheye models distort the equidistant projection: the same direction at a distance from the axis equal to its angle.
Vector2d EquidistantFromPlane(const Vector2d& x) {
  const double radius = x.norm();
  if (radius < 1e-12) return x;
  return x * (std::atan(radius) / radius);
}

Vector2d PlaneFromEquidistant(const Vector2d& x) {
  const double angle = x.norm();
  if (angle < 1e-12) return x;
  return x * (std::tan(std::min(angle, kLargestAngle)) / angle);
}

// The FOV model of Devernay and Faugeras (2001).
Vector2d DistortFov(const Vector2d& x, double omega) {
  const double radius = x.norm();
  if (radius < 1e-12 || std::abs(omega) < 1e-9) return x;
  return x * (std::atan(2 * radius * std::tan(omega / 2)) / (radius * omega));
}

Vector2d UndistortFov(const Vector2d& x, double omega) {
  const double radius = x.norm();
  if (radius < 1e-12 || std::abs(omega) < 1e-9) return x;
  const double angle = std::clamp(radius * omega, -kLargestAngle, kLargestAngle);
  return x * (std::tan(angle) / (2 * radius * std::tan(omega / 2)));
}

// The division model takes its coordinates from the distorted ones: x = x_d / (1 + k r_d^2). Of the two r_d the one
// that goes to r with k; beyond the largest r there is none, and the border stands for it.
Vector2d DistortDivision(const Vector2d& x, double k) {
  const double r2 = x.squaredNorm();
  return x * (2 / (1 + std::sqrt(std::max(0.0, 1 - 4 * k * r2))));
}

Vector2d UndistortDivision(const Vector2d& x, double k) {
  constexpr double kSmallest = 1e-6;
  return x / std::max(kSmallest, 1 + k * x.squaredNorm());
}

Vector2d DistortEucm(const Vector2d& x, double alpha, double beta) {
  return x / (alpha * std::sqrt(beta * x.squaredNorm() + 1) + (1 - alpha));
}

Vector2d UndistortEucm(const Vector2d& x, double alpha, double beta) {
  const double br2 = beta * x.squaredNorm();
  const double root = std::sqrt(std::max(0.0, 1 - (2 * alpha - 1) * br2));
  const double z = (1 - alpha * alpha * br2) / (alpha * root + (1 - alpha));
  constexpr double kSmallest = 1e-6;
  return x / std::max(kSmallest, z);
}

// Project Aria's: polynomial in the angle, then tangential and prism terms of what that gives.
Vector2d DistortRadTanThinPrism(const std::array<double, 12>& c, const Vector2d& x) {
  const double r2 = x.squaredNorm();
  double factor = 0;
  for (size_t i = 6; i-- > 0;) factor = r2 * (factor + c[i]);
  const Vector2d y = x * (1 + factor);
  const double q2 = y.squaredNorm();
  const double ab = y.x() * y.y();
  return y + Vector2d(2 * c[7] * ab + c[6] * (q2 + 2 * y.x() * y.x()) + q2 * (c[8] + q2 * c[9]),
                      2 * c[6] * ab + c[7] * (q2 + 2 * y.y() * y.y()) + q2 * (c[10] + q2 * c[11]));
}

// The models that are a radial polynomial (or quotient of two) with tangential and prism terms, on coordinates that are
// on the plane z = 1 or, for the fisheyes, equidistant.
Vector2d DistortPolynomial(const Lens& lens, const Vector2d& x) {
  const std::array<double, 12>& c = lens.coefficients;
  const double r2 = x.squaredNorm();
  const auto tangential = [&](double p1, double p2) -> Vector2d {
    const double xy = x.x() * x.y();
    return {2 * p1 * xy + p2 * (r2 + 2 * x.x() * x.x()), p1 * (r2 + 2 * x.y() * x.y()) + 2 * p2 * xy};
  };
  switch (lens.model) {
    case Lens::Model::kRadial:
    case Lens::Model::kRadialFisheye:
      return x * (1 + r2 * (c[0] + r2 * c[1]));
    case Lens::Model::kOpenCv:
      return x * (1 + r2 * (c[0] + r2 * c[1])) + tangential(c[2], c[3]);
    case Lens::Model::kFullOpenCv:
      return x * ((1 + r2 * (c[0] + r2 * (c[1] + r2 * c[4]))) / (1 + r2 * (c[5] + r2 * (c[6] + r2 * c[7])))) +
             tangential(c[2], c[3]);
    case Lens::Model::kOpenCvFisheye:
      return x * (1 + r2 * (c[0] + r2 * (c[1] + r2 * (c[2] + r2 * c[3]))));
    case Lens::Model::kThinPrismFisheye:
      return x * (1 + r2 * (c[0] + r2 * (c[1] + r2 * (c[4] + r2 * c[5])))) + tangential(c[2], c[3]) +
             Vector2d(c[6] * r2, c[7] * r2);
    case Lens::Model::kBrown:
      return x * (1 + r2 * (c[0] + r2 * (c[1] + r2 * (c[4] + r2 * c[5])))) + tangential(c[2], c[3]);
    case Lens::Model::kRadTanThinPrismFisheye:
      return DistortRadTanThinPrism(c, x);
    case Lens::Model::kPinhole:
    case Lens::Model::kFov:
    case Lens::Model::kDivision:
    case Lens::Model::kEucm:
      break;
  }
  return x;
}

// Newton's method with a Jacobian by central differences. A step that does not bring the image closer is halved, so the
// iteration never runs off; where the model folds over and there is no solution it returns the closest that it met.
Vector2d InvertPolynomial(const Lens& lens, const Vector2d& distorted) {
  constexpr double kDifference = 1e-6;
  constexpr int kIterations = 50;
  constexpr int kHalvings = 12;
  Vector2d x = distorted;
  Vector2d residual = DistortPolynomial(lens, x) - distorted;
  for (int i = 0; i < kIterations && residual.squaredNorm() > 1e-26; ++i) {
    Matrix2d jacobian;
    for (int k = 0; k < 2; ++k) {
      const Vector2d step = kDifference * Vector2d::Unit(k);
      jacobian.col(k) = (DistortPolynomial(lens, x + step) - DistortPolynomial(lens, x - step)) / (2 * kDifference);
    }
    if (std::abs(jacobian.determinant()) < 1e-9) break;
    Vector2d step = jacobian.inverse() * residual;
    bool closer = false;
    for (int h = 0; h < kHalvings && !closer; ++h, step *= 0.5) {
      const Vector2d candidate = x - step;
      const Vector2d candidate_residual = DistortPolynomial(lens, candidate) - distorted;
      closer = candidate_residual.squaredNorm() < residual.squaredNorm();
      if (closer) {
        x = candidate;
        residual = candidate_residual;
      }
    }
    if (!closer) break;
  }
  return x;
}

}  // namespace

Vector2d Lens::Distort(const Vector2d& undistorted) const {
  if (model == Model::kPinhole) return undistorted;
  if (model == Model::kFov) return DistortFov(undistorted, coefficients[0]);
  if (model == Model::kDivision) return DistortDivision(undistorted, coefficients[0]);
  if (model == Model::kEucm) return DistortEucm(undistorted, coefficients[0], coefficients[1]);
  return DistortPolynomial(*this, IsFisheye(model) ? EquidistantFromPlane(undistorted) : undistorted);
}

Vector2d Lens::PixelFromPlane(const Vector2d& undistorted) const {
  const Vector2d x = Distort(undistorted);
  return {fx * x.x() + skew * x.y() + cx, fy * x.y() + cy};
}

Vector2d Lens::PlaneFromPixel(const Vector2d& pixel) const {
  const double y = (pixel.y() - cy) / fy;
  Vector2d distorted((pixel.x() - cx - skew * y) / fx, y);
  if (model == Model::kPinhole) return distorted;
  if (model == Model::kFov) return UndistortFov(distorted, coefficients[0]);
  if (model == Model::kDivision) return UndistortDivision(distorted, coefficients[0]);
  if (model == Model::kEucm) return UndistortEucm(distorted, coefficients[0], coefficients[1]);
  const Vector2d x = InvertPolynomial(*this, distorted);
  return IsFisheye(model) ? PlaneFromEquidistant(x) : x;
}

}  // namespace meshwright
