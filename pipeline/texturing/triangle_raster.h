// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>

#include <Eigen/Core>

namespace meshwright {

// A rectangle of pixels: columns [x0, x1), rows [y0, y1).
struct PixelBox {
  int x0 = 0;
  int y0 = 0;
  int x1 = 0;
  int y1 = 0;

  int width() const { return x1 - x0; }
  int height() const { return y1 - y0; }
};

// A triangle in an image, for asking where a pixel lies in it.
class ImageTriangle {
 public:
  ImageTriangle(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c) : a_(a), b_(b), c_(c) {
    doubled_area_ = Cross(b - a, c - a);
  }

  double area() const { return 0.5 * std::abs(doubled_area_); }  // px^2

  // Barycentric coordinates of a point: sum 1, all >= 0 inside. The area must not be 0.
  Eigen::Vector3d Weights(const Eigen::Vector2d& p) const {
    const double wa = Cross(b_ - p, c_ - p) / doubled_area_;
    const double wb = Cross(c_ - p, a_ - p) / doubled_area_;
    return {wa, wb, 1 - wa - wb};
  }

  // Calls visit(column, row, weights) for each pixel of `box` whose centre lies in the triangle.
  template <typename Visit>
  void ForEachPixel(const PixelBox& box, const Visit& visit) const {
    if (!(std::abs(doubled_area_) > 0)) return;
    const double low_x = std::min({a_.x(), b_.x(), c_.x()});
    const double low_y = std::min({a_.y(), b_.y(), c_.y()});
    const double high_x = std::max({a_.x(), b_.x(), c_.x()});
    const double high_y = std::max({a_.y(), b_.y(), c_.y()});
    if (!(low_x < box.x1 && low_y < box.y1 && high_x > box.x0 && high_y > box.y0)) return;
    const int x0 = std::max<int>(box.x0, static_cast<int>(std::ceil(low_x - 0.5)));
    const int y0 = std::max<int>(box.y0, static_cast<int>(std::ceil(low_y - 0.5)));
    const int x1 = std::min<int>(box.x1 - 1, static_cast<int>(std::floor(high_x - 0.5)));
    const int y1 = std::min<int>(box.y1 - 1, static_cast<int>(std::floor(high_y - 0.5)));
    const double wa_step = (b_.y() - c_.y()) / doubled_area_;
    const double wb_step = (c_.y() - a_.y()) / doubled_area_;
    for (int y = y0; y <= y1; ++y) {
      const Eigen::Vector3d first = Weights({x0 + 0.5, y + 0.5});
      for (int x = x0; x <= x1; ++x) {
        const double wa = first.x() + (x - x0) * wa_step;
        const double wb = first.y() + (x - x0) * wb_step;
        const double wc = 1 - wa - wb;
        if (wa >= 0 && wb >= 0 && wc >= 0) visit(x, y, Eigen::Vector3d(wa, wb, wc));
      }
    }
  }

 private:
  static double Cross(const Eigen::Vector2d& u, const Eigen::Vector2d& v) { return u.x() * v.y() - u.y() * v.x(); }

  Eigen::Vector2d a_;
  Eigen::Vector2d b_;
  Eigen::Vector2d c_;
  double doubled_area_ = 0;
};

}  // namespace meshwright
