// SPDX-License-Identifier: Apache-2.0
#include "tools/raycast/depth_map.h"

#include <algorithm>
#include <array>

namespace meshwright {

DepthMap RenderDepth(const MeshRayCaster& caster, const Camera& camera, int step, ThreadPool& pool) {
  DepthMap map;
  map.lattice = Lattice::For(camera, step);
  const auto nodes = static_cast<size_t>(map.lattice.nodes());
  map.depth.assign(nodes, 0.0F);
  map.face.assign(nodes, -1);
  map.normal_in_world.assign(nodes, Eigen::Vector3f::Zero());
  const Eigen::Vector3d center = camera.center_in_world();
  const Eigen::Matrix3d world_from_cam = camera.cam_from_world.rotation.transpose();
  pool.ParallelFor(map.lattice.rows, 4, [&](int64_t begin, int64_t end) {
    for (int row = static_cast<int>(begin); row < static_cast<int>(end); ++row) {
      for (int column = 0; column < map.lattice.columns; column += 4) {
        const int count = std::min(4, map.lattice.columns - column);
        std::array<Eigen::Vector3d, 4> directions;
        for (int i = 0; i < 4; ++i) {
          const Eigen::Vector2d pixel = map.lattice.Pixel(column + std::min(i, count - 1), row);
          directions[static_cast<size_t>(i)] = world_from_cam * camera.RayInCam(pixel.x(), pixel.y());
        }
        const std::array<RayHit, 4> hits = caster.Cast4(center, directions);
        for (int i = 0; i < count; ++i) {
          const RayHit& hit = hits[static_cast<size_t>(i)];
          if (!hit.ok()) continue;
          const auto node = static_cast<size_t>(map.lattice.Index(column + i, row));
          const Eigen::Vector3d normal = caster.FaceNormal(hit.face);
          const bool towards_camera = normal.dot(directions[static_cast<size_t>(i)]) <= 0;
          map.depth[node] = static_cast<float>(hit.distance);
          map.face[node] = hit.face;
          map.normal_in_world[node] = (towards_camera ? normal : -normal).cast<float>();
        }
      }
    }
  });
  return map;
}

}  // namespace meshwright
