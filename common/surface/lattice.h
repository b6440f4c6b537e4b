// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include <Eigen/Core>

#include "common/geometry/camera.h"

namespace meshwright {

// The lattice of rays of one camera: every `step`-th pixel centre in x and y (gamma_r of section 3.3, Jancosek et al.
// 2009). Node (column, row) lies at pixel step * column + step / 2 (integer division) + 0.5 and likewise in y, so rays
// go through pixel centres and windows of the reference image need no interpolation.
struct Lattice {
  int step = 1;  // px
  int columns = 0;
  int rows = 0;

  static Lattice For(const Camera& camera, int step) {
    const int offset = step / 2;
    return {step, camera.width > offset ? (camera.width - offset - 1) / step + 1 : 0,
            camera.height > offset ? (camera.height - offset - 1) / step + 1 : 0};
  }

  int64_t nodes() const { return static_cast<int64_t>(columns) * rows; }
  int64_t Index(int column, int row) const { return static_cast<int64_t>(row) * columns + column; }
  bool Contains(int column, int row) const { return column >= 0 && row >= 0 && column < columns && row < rows; }
  // Integer pixel of the node; its centre is 0.5 further.
  int PixelX(int column) const { return step * column + step / 2; }
  int PixelY(int row) const { return step * row + step / 2; }
  Eigen::Vector2d Pixel(int column, int row) const { return {PixelX(column) + 0.5, PixelY(row) + 0.5}; }
  // Real-valued lattice coordinates of a pixel; the inverse of Pixel().
  Eigen::Vector2d FromPixel(const Eigen::Vector2d& pixel) const {
    const double offset = PixelX(0) + 0.5;
    return {(pixel.x() - offset) / step, (pixel.y() - offset) / step};
  }
};

}  // namespace meshwright
