// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>
#include <absl/types/span.h>

#include "tools/raycast/mesh_ray_caster.h"

#include "common/base/thread_pool.h"
#include "common/geometry/camera.h"
#include "common/mesh/triangle_mesh.h"
#include "common/surface/lattice.h"

namespace meshwright {

// What one camera sees of a mesh or cloud at the nodes of a lattice, row by row.
struct SeenSurface {
  Lattice lattice;
  std::vector<double> depth;                // z in the camera's frame; 0: nothing there
  std::vector<Eigen::Vector3d> x_in_world;  // valid where depth > 0
  std::vector<int32_t> face;                // valid for a mesh where depth > 0
};

// A mesh is seen by a ray through each node. A cloud is seen by its nearest point in each node's pixel.
SeenSurface SeeSurface(const TriangleMesh& mesh, const MeshRayCaster& caster, const Camera& camera, int stride,
                       ThreadPool& pool);

// Whether at least `min_views` cameras see the surface point x from the side to which `normal` points: x is in the
// picture and nothing lies more than `tolerance` pixel footprints in front of it.
bool IsSeenByEnough(const MeshRayCaster& caster, absl::Span<const Camera> cameras, const Eigen::Vector3d& x,
                    const Eigen::Vector3d& normal, int min_views, double tolerance);

// A point on a triangle.
struct SurfaceSample {
  Eigen::Vector3d x = Eigen::Vector3d::Zero();
  int32_t face = 0;
};

// Points spread evenly over the mesh's area, always the same ones.
std::vector<SurfaceSample> SampleSurface(const TriangleMesh& mesh, int count);

}  // namespace meshwright
