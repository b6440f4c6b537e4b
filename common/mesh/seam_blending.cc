#include "common/mesh/seam_blending.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

namespace meshwright {
namespace {

// A ray closer to the surface's plane is not moved any further along itself.
constexpr double kMinRayCosine = 0.25;

using Offset = Eigen::Vector4f;  // colour, displacement

void ApplyOffset(const Offset& offset, size_t node, PatchLattice& surface) {
  for (int k = 0; k < 3; ++k) {
    uint8_t& channel = surface.rgb[node][static_cast<size_t>(k)];
    channel = static_cast<uint8_t>(std::clamp(std::round(static_cast<float>(channel) + offset[k]), 0.0F, 255.0F));
  }
  const auto column = static_cast<int>(static_cast<int64_t>(node) % surface.lattice.columns);
  const auto row = static_cast<int>(static_cast<int64_t>(node) / surface.lattice.columns);
  const Eigen::Vector2d pixel = surface.lattice.Pixel(column, row);
  const Eigen::Vector3d ray_in_cam = surface.camera.RayInCam(pixel.x(), pixel.y());
  const Eigen::Vector3d normal_in_cam =
      surface.camera.cam_from_world.rotation * surface.normal_in_world[node].cast<double>();
  const double length = ray_in_cam.norm();
  const double cosine = std::min(normal_in_cam.dot(ray_in_cam) / length, -kMinRayCosine);
  const double depth = surface.depth[node] + offset[3] / (cosine * length);
  if (depth > 0.5 * surface.depth[node]) surface.depth[node] = static_cast<float>(depth);
}

}  // namespace

void BlendSeams(const std::vector<SeamOffset>& offsets, int steps, PatchLattice& surface) {
  if (offsets.empty() || steps == 0) return;
  std::vector<int32_t> ring_of_node(surface.depth.size(), 0);  // 0: not reached, 1: on the seam
  std::vector<std::pair<int32_t, Offset>> ring;
  std::vector<int32_t> entry_of_node(surface.depth.size(), 0);  // position in its ring, where it has one
  for (const SeamOffset& seam : offsets) {
    const auto node = static_cast<size_t>(seam.node);
    if (ring_of_node[node] != 0) continue;  // several vertices in one patch: the first one speaks
    ring_of_node[node] = 1;
    entry_of_node[node] = static_cast<int32_t>(ring.size());
    ring.emplace_back(seam.node, Offset(seam.color.x(), seam.color.y(), seam.color.z(), seam.displacement));
  }
  const int32_t columns = surface.lattice.columns;
  const auto for_each_linked = [&](int32_t node, const auto& visit) {
    const uint8_t links = surface.links[static_cast<size_t>(node)];
    if ((links & PatchLattice::kLinkRight) != 0) visit(node + 1);
    if ((links & PatchLattice::kLinkDown) != 0) visit(node + columns);
    if (node % columns > 0 && (surface.links[static_cast<size_t>(node - 1)] & PatchLattice::kLinkRight) != 0) {
      visit(node - 1);
    }
    if (node >= columns && (surface.links[static_cast<size_t>(node - columns)] & PatchLattice::kLinkDown) != 0) {
      visit(node - columns);
    }
  };
  std::vector<std::pair<int32_t, Offset>> next_ring;
  for (int32_t k = 1; k <= steps; ++k) {
    next_ring.clear();
    for (const auto& [node, offset] : ring) {
      for_each_linked(node, [&](int32_t neighbour) {
        auto& reached = ring_of_node[static_cast<size_t>(neighbour)];
        if (reached != 0) return;
        reached = k + 1;
        entry_of_node[static_cast<size_t>(neighbour)] = static_cast<int32_t>(next_ring.size());
        next_ring.emplace_back(neighbour, Offset::Zero());
      });
    }
    for (auto& [node, offset] : next_ring) {
      float weight = 0;
      for_each_linked(node, [&](int32_t neighbour) {
        if (ring_of_node[static_cast<size_t>(neighbour)] != k) return;
        offset += ring[static_cast<size_t>(entry_of_node[static_cast<size_t>(neighbour)])].second;
        weight += 1;
      });
      offset /= weight;
    }
    const float fade = static_cast<float>(steps + 1 - k) / static_cast<float>(steps);
    for (const auto& [node, offset] : ring) ApplyOffset(offset * fade, static_cast<size_t>(node), surface);
    std::swap(ring, next_ring);
  }
}

}  // namespace meshwright
