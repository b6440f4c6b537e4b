// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "tools/raycast/mesh_ray_caster.h"

#include "common/base/thread_pool.h"
#include "common/geometry/camera.h"
#include "common/surface/lattice.h"

namespace meshwright {

// What a camera sees of a mesh through the nodes of a lattice. Arrays over lattice.nodes(), row by row.
struct DepthMap {
  Lattice lattice;
  std::vector<float> depth;                      // z in the camera's frame; 0: nothing there
  std::vector<int32_t> face;                     // -1: nothing there
  std::vector<Eigen::Vector3f> normal_in_world;  // of the triangle, unit, towards the camera; zero: nothing there
};

// Casts a ray through every node of Lattice::For(camera, step).
DepthMap RenderDepth(const MeshRayCaster& caster, const Camera& camera, int step, ThreadPool& pool);

}  // namespace meshwright
