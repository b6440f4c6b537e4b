#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "common/base/ids.h"

namespace meshwright {

// Triangles with attributes per vertex. Each attribute array is either empty or has one entry per vertex.
struct TriangleMesh {
  std::vector<Eigen::Vector3f> positions;      // scene units, world frame
  std::vector<Eigen::Vector3f> normals;        // unit, outwards (towards the cameras)
  std::vector<std::array<uint8_t, 3>> colors;  // RGB
  std::vector<float> quality;                  // photo-consistency in [-1, 1]
  std::vector<CameraIndex> cameras;            // reference camera that owns the vertex
  std::vector<std::array<uint32_t, 3>> faces;  // counter-clockwise seen from outside
};

}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
