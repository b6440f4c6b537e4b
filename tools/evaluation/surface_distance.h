// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include <Eigen/Core>

#include "tools/raycast/mesh_ray_caster.h"

#include "common/mesh/triangle_mesh.h"

namespace meshwright {

// Distance to the nearest point of a cloud. Safe to ask from several threads.
class PointCloudDistance {
 public:
  // `cloud` must outlive this.
  explicit PointCloudDistance(const std::vector<Eigen::Vector3f>& cloud);
  ~PointCloudDistance();

  // Infinite when no point lies within `radius`.
  double Within(const Eigen::Vector3d& x, double radius) const;

 private:
  struct Tree;
  std::unique_ptr<Tree> tree_;
};

// The same for what has faces: distance to the nearest point of the triangles; for what has none, to the vertices.
class SurfaceDistance {
 public:
  // `mesh` and `caster` (of the same mesh) must outlive this.
  SurfaceDistance(const TriangleMesh& mesh, const MeshRayCaster& caster);

  // Infinite when nothing lies within `radius`.
  double Within(const Eigen::Vector3d& x, double radius) const;

 private:
  const MeshRayCaster& caster_;
  std::unique_ptr<PointCloudDistance> cloud_;  // null for a mesh
};

}  // namespace meshwright
