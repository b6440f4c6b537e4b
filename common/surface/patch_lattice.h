// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "common/base/ids.h"
#include "common/geometry/camera.h"
#include "common/surface/lattice.h"

namespace meshwright {

// At most one patch per ray of one camera: the type of F_r (filtered surface) and M_r (accepted surface) of section
// 3.7, Jancosek et al. 2009. Dense arrays over lattice.nodes(), row by row; depth 0 means "no patch on this ray".
struct PatchLattice {
  // links[i] bits: this node's patch and the one of the next node to the right / below are one surface (their pairwise
  // cost in the MRF is finite). Set only when both have a patch.
  static constexpr uint8_t kLinkRight = 1;
  static constexpr uint8_t kLinkDown = 2;

  // Of patches that no photograph confirms: what surrounds them says where they lie.
  static constexpr float kInferredQuality = 0;

  CameraIndex camera_index = 0;
  Camera camera;
  Lattice lattice;
  std::vector<float> depth;                      // z in the camera's frame, scene units
  std::vector<Eigen::Vector3f> normal_in_world;  // unit, towards the camera
  std::vector<float> quality;                    // photo-consistency, in [-1, 1]; kInferredQuality: not measured
  std::vector<std::array<uint8_t, 3>> rgb;       // the reference photograph at the node
  std::vector<uint8_t> links;

  static PatchLattice Empty(CameraIndex camera_index, const Camera& camera, int step) {
    PatchLattice surface;
    surface.camera_index = camera_index;
    surface.camera = camera;
    surface.lattice = Lattice::For(camera, step);
    const auto nodes = static_cast<size_t>(surface.lattice.nodes());
    surface.depth.assign(nodes, 0.0F);
    surface.normal_in_world.assign(nodes, Eigen::Vector3f::Zero());
    surface.quality.assign(nodes, 0.0F);
    surface.rgb.assign(nodes, {0, 0, 0});
    surface.links.assign(nodes, 0);
    return surface;
  }

  bool HasPatch(int64_t node) const { return depth[static_cast<size_t>(node)] > 0; }

  bool IsInferred(int64_t node) const {
    return HasPatch(node) && quality[static_cast<size_t>(node)] == kInferredQuality;
  }

  int64_t CountPatches() const {
    int64_t count = 0;
    for (const float z : depth) count += z > 0 ? 1 : 0;
    return count;
  }

  int64_t CountInferred() const {
    int64_t count = 0;
    for (int64_t node = 0; node < lattice.nodes(); ++node) count += IsInferred(node) ? 1 : 0;
    return count;
  }

  // Centre X of the node's patch in world coordinates. The node must have one.
  Eigen::Vector3d Point(int column, int row) const {
    const Eigen::Vector2d pixel = lattice.Pixel(column, row);
    return camera.BackProject(pixel.x(), pixel.y(), depth[static_cast<size_t>(lattice.Index(column, row))]);
  }
};

}  // namespace meshwright
