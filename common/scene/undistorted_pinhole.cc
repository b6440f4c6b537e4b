// SPDX-License-Identifier: Apache-2.0
#include "common/scene/undistorted_pinhole.h"

#include <algorithm>
#include <cmath>

namespace meshwright {
namespace {

using Eigen::Vector2d;

constexpr double kLargestTangent = 2;
constexpr int kSamplesPerSide = 96;

// A rectangle of the plane z = 1.
struct PlaneRectangle {
  double x0;
  double y0;
  double x1;
  double y1;
};

// Whether the distortion keeps its orientation near `point`: where it does not, the model has folded over.
bool Unfolded(const Lens& lens, const Vector2d& point) {
  constexpr double kDifference = 1e-4;
  const Vector2d dx = lens.Distort(point + Vector2d(kDifference, 0)) - lens.Distort(point - Vector2d(kDifference, 0));
  const Vector2d dy = lens.Distort(point + Vector2d(0, kDifference)) - lens.Distort(point - Vector2d(0, kDifference));
  return dx.x() * dy.y() - dx.y() * dy.x() > 0;
}

bool UnfoldedUpTo(const Lens& lens, const Vector2d& point) {
  constexpr int kSteps = 16;
  for (int i = 1; i <= kSteps; ++i) {
    if (!Unfolded(lens, point * (static_cast<double>(i) / kSteps))) return false;
  }
  return true;
}

// How far one can go from the axis in a direction of unit length.
double UnfoldedExtent(const Lens& lens, const Vector2d& direction) {
  constexpr int kSteps = 256;
  int i = 0;
  while (i < kSteps && Unfolded(lens, direction * (kLargestTangent * (i + 1) / kSteps))) ++i;
  return kLargestTangent * i / kSteps;
}

// What lies between the undistorted borders of the picture, as far as the lens can be inverted. The borders are smooth,
// so samples tell.
PlaneRectangle RectangleInsideBorders(const Lens& lens) {
  PlaneRectangle rectangle{.x0 = -UnfoldedExtent(lens, {-1, 0}),
                           .y0 = -UnfoldedExtent(lens, {0, -1}),
                           .x1 = UnfoldedExtent(lens, {1, 0}),
                           .y1 = UnfoldedExtent(lens, {0, 1})};
  // Where the lens has no inverse (the direction is 90 degrees off, or the model folds over) there is no border here.
  const auto plane_from_pixel = [&](const Vector2d& pixel, auto&& use) {
    const Vector2d point = lens.PlaneFromPixel(pixel);
    if (point.allFinite() && (lens.PixelFromPlane(point) - pixel).norm() < 1e-3 && UnfoldedUpTo(lens, point)) {
      use(point);
    }
  };
  for (int i = 0; i <= kSamplesPerSide; ++i) {
    const double x = static_cast<double>(lens.width) * i / kSamplesPerSide;
    const double y = static_cast<double>(lens.height) * i / kSamplesPerSide;
    plane_from_pixel({0, y}, [&](const Vector2d& p) { rectangle.x0 = std::max(rectangle.x0, p.x()); });
    plane_from_pixel({lens.width, y}, [&](const Vector2d& p) { rectangle.x1 = std::min(rectangle.x1, p.x()); });
    plane_from_pixel({x, 0}, [&](const Vector2d& p) { rectangle.y0 = std::max(rectangle.y0, p.y()); });
    plane_from_pixel({x, lens.height}, [&](const Vector2d& p) { rectangle.y1 = std::min(rectangle.y1, p.y()); });
  }
  return rectangle;
}

// Whether a point of the rectangle's border is imaged inside the picture, and nothing folds on the way to it.
bool IsSeen(const Lens& lens, const Vector2d& point) {
  constexpr double kTolerance = 0.25;  // px; half a pixel outside is still the outermost pixel
  const Vector2d pixel = lens.PixelFromPlane(point);
  const bool inside = pixel.x() >= -kTolerance && pixel.y() >= -kTolerance && pixel.x() <= lens.width + kTolerance &&
                      pixel.y() <= lens.height + kTolerance;
  return inside && UnfoldedUpTo(lens, point);
}

bool IsSeen(const Lens& lens, const PlaneRectangle& r) {
  for (int i = 0; i <= kSamplesPerSide; ++i) {
    const double t = static_cast<double>(i) / kSamplesPerSide;
    const double x = r.x0 + t * (r.x1 - r.x0);
    const double y = r.y0 + t * (r.y1 - r.y0);
    if (!IsSeen(lens, Vector2d(x, r.y0)) || !IsSeen(lens, Vector2d(x, r.y1)) || !IsSeen(lens, Vector2d(r.x0, y)) ||
        !IsSeen(lens, Vector2d(r.x1, y))) {
      return false;
    }
  }
  return true;
}

}  // namespace

Camera LargestPinhole(const Lens& lens) {
  Camera camera{.width = lens.width, .height = lens.height, .fx = lens.fx, .fy = lens.fy, .cx = lens.cx, .cy = lens.cy};
  if (lens.is_plain_pinhole()) return camera;

  PlaneRectangle rectangle = RectangleInsideBorders(lens);
  // Borders that were found hold at once; the loop is for lenses whose model folds over inside the picture.
  constexpr double kShrink = 0.98;
  constexpr int kShrinkings = 200;
  bool seen = false;
  for (int i = 0; i < kShrinkings && !seen; ++i) {
    if (!(rectangle.x0 < rectangle.x1 && rectangle.y0 < rectangle.y1)) break;
    seen = IsSeen(lens, rectangle);
    if (!seen) {
      rectangle = {kShrink * rectangle.x0, kShrink * rectangle.y0, kShrink * rectangle.x1, kShrink * rectangle.y1};
    }
  }
  if (!seen) return Camera{.fx = lens.fx, .fy = lens.fy};

  constexpr double kRounding = 1e-6;  // px
  const double left = std::ceil(lens.cx + lens.fx * rectangle.x0 - kRounding);
  const double top = std::ceil(lens.cy + lens.fy * rectangle.y0 - kRounding);
  const double right = std::floor(lens.cx + lens.fx * rectangle.x1 + kRounding);
  const double bottom = std::floor(lens.cy + lens.fy * rectangle.y1 + kRounding);
  if (right - left < 1 || bottom - top < 1) return Camera{.fx = lens.fx, .fy = lens.fy};
  camera.width = static_cast<int>(right - left);
  camera.height = static_cast<int>(bottom - top);
  camera.cx = lens.cx - left;
  camera.cy = lens.cy - top;
  return camera;
}

}  // namespace meshwright
