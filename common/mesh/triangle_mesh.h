// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "common/base/ids.h"

namespace meshwright {

// Triangles with attributes per vertex. Each attribute array is either empty or has one entry per vertex.
struct TriangleMesh {
  std::vector<Eigen::Vector3f> positions;      // scene units, world frame less the offset
  std::vector<Eigen::Vector3f> normals;        // unit, outwards (towards the cameras)
  std::vector<std::array<uint8_t, 3>> colors;  // RGB
  std::vector<float> quality;                  // photo-consistency in [-1, 1]
  std::vector<CameraIndex> cameras;            // reference camera that owns the vertex
  std::vector<std::array<uint32_t, 3>> faces;  // counter-clockwise seen from outside
  // world = position + offset; not 0 where coordinates are too far from zero for floats (Scene::offset).
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();
};

// Expresses the same mesh with another offset.
inline void ChangeOffset(const Eigen::Vector3d& offset, TriangleMesh& mesh) {
  if (mesh.offset == offset) return;
  const Eigen::Vector3d move = mesh.offset - offset;
  for (Eigen::Vector3f& x : mesh.positions) x = (x.cast<double>() + move).cast<float>();
  mesh.offset = offset;
}

}  // namespace meshwright
