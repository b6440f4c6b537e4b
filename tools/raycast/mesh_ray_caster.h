// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory>

#include <Eigen/Core>

#include "common/mesh/triangle_mesh.h"

namespace meshwright {

// First triangle met along a ray.
struct RayHit {
  int32_t face = -1;    // index into TriangleMesh::faces; -1: the ray meets nothing
  double distance = 0;  // in lengths of the ray's direction: depth z when the direction has z = 1 in a camera's frame
  float u = 0;          // barycentric coordinates: x = (1 - u - v) a + u b + v c
  float v = 0;

  bool ok() const { return face >= 0; }
};

// Point of the mesh that is nearest to a query.
struct NearestSurfacePoint {
  int32_t face = -1;  // -1: nothing within the radius asked for
  double distance = std::numeric_limits<double>::infinity();

  bool ok() const { return face >= 0; }
};

// Rays and nearest points on a triangle mesh, by Embree in robust mode; distances are computed anew in double from the
// triangle that was found. Both sides of a triangle count. Built by one thread, so that equal meshes give equal trees.
// Every face index must be a vertex. All queries may be made from several threads.
class MeshRayCaster {
 public:
  static constexpr double kInfinity = std::numeric_limits<double>::infinity();

  // Copies what it needs of the mesh. A mesh without faces is met by no ray.
  explicit MeshRayCaster(const TriangleMesh& mesh);
  ~MeshRayCaster();
  MeshRayCaster(MeshRayCaster&&) noexcept;
  MeshRayCaster& operator=(MeshRayCaster&&) noexcept;

  RayHit Cast(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const;

  // Four rays from one origin. Much faster than four calls when the rays are close to each other.
  std::array<RayHit, 4> Cast4(const Eigen::Vector3d& origin, const std::array<Eigen::Vector3d, 4>& directions) const;

  // Whether any triangle lies between `near` and `far` (in lengths of `direction`).
  bool IsBlocked(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double near, double far) const;

  // IsBlocked for up to four rays with a common direction, from `near` to infinity. Bit i of `active` and of the answer
  // belongs to origins[i].
  uint32_t AreBlocked4(const std::array<Eigen::Vector3d, 4>& origins, const Eigen::Vector3d& direction, double near,
                       uint32_t active) const;

  // The nearest point within `radius` (may be infinite).
  NearestSurfacePoint Nearest(const Eigen::Vector3d& x, double radius) const;

  // Unit normal by the right-hand rule over the face's corners; zero when the face has no area.
  Eigen::Vector3d FaceNormal(int32_t face) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace meshwright
