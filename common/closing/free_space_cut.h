// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>
#include <absl/types/span.h>

namespace meshwright {

// A point of measured surface.
struct MeasuredPoint {
  Eigen::Vector3d x_in_world = Eigen::Vector3d::Zero();
  double spacing = 0;  // scene units, > 0: how far measured points around it are apart
};

// A camera has measured a point, so what lies between them is empty.
struct Sight {
  int32_t point = 0;
  int32_t camera = 0;
};

// Where empty space ends: triangles of points, counter-clockwise seen from the empty side.
//
// Space is cut into the Delaunay tetrahedra of points and camera centres, and each is called empty or solid by a
// minimum cut (Labatut et al. 2007; Jancosek and Pajdla 2011 build on it): a triangle costs one for each sight that
// crosses it, less close to the sight's point; the tetrahedron a little behind a point is solid unless that costs more;
// those around cameras are empty; what lies outside the hull is solid; and triangles that lie badly in the spheres
// around their tetrahedra cost up to one. Costs are integers, so that the cut does not depend on rounding. Its time
// grows little faster than the number of points.
std::vector<std::array<int32_t, 3>> CutFreeSpace(absl::Span<const MeasuredPoint> points,
                                                 absl::Span<const Eigen::Vector3d> camera_centers_in_world,
                                                 absl::Span<const Sight> sights);

}  // namespace meshwright
