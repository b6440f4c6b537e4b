// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <random>

#include <Eigen/Geometry>

#include "common/surface/patch_lattice.h"

namespace meshwright {

// A camera whose lattice with step 1 has this size. For tests.
inline Camera SmallCamera(int width, int height) {
  Camera camera{width, height, 1.2 * width, 1.2 * width, 0.5 * width, 0.5 * height, {}};
  camera.cam_from_world.rotation = Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  camera.cam_from_world.translation = Eigen::Vector3d(0.1, -0.2, 0.3);
  return camera;
}

// A surface that has a patch on each ray with probability `density`, and each possible link with probability
// `link_density`. For tests.
inline PatchLattice RandomSurface(uint32_t seed, const Camera& camera, int step, double density, double link_density) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0, 1);
  PatchLattice surface = PatchLattice::Empty(static_cast<CameraIndex>(seed), camera, step);
  const Lattice& lattice = surface.lattice;
  for (size_t node = 0; node < surface.depth.size(); ++node) {
    if (unit(random) >= density) continue;
    surface.depth[node] = 1 + unit(random);
    surface.normal_in_world[node] =
        Eigen::Vector3f(unit(random) - 0.5F, unit(random) - 0.5F, -unit(random) - 0.1F).normalized();
    surface.quality[node] = unit(random);
    for (uint8_t& channel : surface.rgb[node]) channel = static_cast<uint8_t>(255 * unit(random));
  }
  for (int row = 0; row < lattice.rows; ++row) {
    for (int column = 0; column < lattice.columns; ++column) {
      const int64_t node = lattice.Index(column, row);
      if (!surface.HasPatch(node)) continue;
      uint8_t& links = surface.links[static_cast<size_t>(node)];
      if (column + 1 < lattice.columns && surface.HasPatch(node + 1) && unit(random) < link_density) {
        links |= PatchLattice::kLinkRight;
      }
      if (row + 1 < lattice.rows && surface.HasPatch(lattice.Index(column, row + 1)) && unit(random) < link_density) {
        links |= PatchLattice::kLinkDown;
      }
    }
  }
  return surface;
}

}  // namespace meshwright
