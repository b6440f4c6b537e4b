// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include <Eigen/Core>

namespace meshwright {

// The Delaunay tetrahedra of points in space (Delaunay 1934), by Qhull (Barber et al. 1996).
class Tetrahedra {
 public:
  static constexpr int32_t kNone = -1;

  struct Tetrahedron {
    std::array<int32_t, 4> corner;    // points; from corner 3 the others run counter-clockwise
    std::array<int32_t, 4> neighbor;  // behind the face opposite to that corner; kNone: outside of the hull
  };
  // A walk leaves a tetrahedron through one of its faces.
  struct Crossing {
    int32_t from = kNone;
    int face = 0;  // of `from`
    int32_t to = kNone;
    double distance = 0;  // from where the walk began, scene units
  };

  // Fewer than five points, or points in one plane, have no tetrahedra. Points move by a joggle of rounding's size
  // while they are triangulated, which depends on them alone; so four in a circle do no harm.
  explicit Tetrahedra(std::vector<Eigen::Vector3d> points);

  const std::vector<Eigen::Vector3d>& points() const { return points_; }
  const std::vector<Tetrahedron>& all() const { return tetrahedra_; }
  // The points of a face, counter-clockwise seen from the corner that it is opposite to.
  std::array<int32_t, 3> Face(int32_t tetrahedron, int face) const;
  // Of two neighbours: the face of `tetrahedron` behind which `neighbor` lies.
  int FaceTowards(int32_t tetrahedron, int32_t neighbor) const;
  // The tetrahedra that have the point as a corner.
  const std::vector<int32_t>& Around(int32_t point) const { return around_[static_cast<size_t>(point)]; }
  // Zero for one without volume.
  Eigen::Vector3d Circumcenter(int32_t tetrahedron) const;

  // From a point along a unit direction, tetrahedron by tetrahedron, until `visit` says false, or outside the hull. The
  // tetrahedron in which the walk starts; kNone when the direction leaves the hull at once.
  int32_t Walk(int32_t point, const Eigen::Vector3d& direction,
               const std::function<bool(const Crossing& crossing)>& visit) const;

 private:
  const Eigen::Vector3d& At(int32_t point) const { return points_[static_cast<size_t>(point)]; }
  // Not normalised, towards the corner.
  Eigen::Vector3d InwardNormal(int32_t tetrahedron, int face) const;
  int32_t StartOf(int32_t point, const Eigen::Vector3d& direction) const;

  std::vector<Eigen::Vector3d> points_;
  std::vector<Tetrahedron> tetrahedra_;
  std::vector<std::vector<int32_t>> around_;
};

}  // namespace meshwright
