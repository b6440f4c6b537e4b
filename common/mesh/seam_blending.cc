#include "common/mesh/seam_blending.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

namespace meshwright {
namespace {

void AddTo(std::array<uint8_t, 3>& rgb, const Eigen::Vector3f& offset) {
  for (size_t k = 0; k < 3; ++k) {
    const float channel = std::round(static_cast<float>(rgb[k]) + offset[static_cast<Eigen::Index>(k)]);
    rgb[k] = static_cast<uint8_t>(std::clamp(channel, 0.0F, 255.0F));
  }
}

}  // namespace

void BlendSeams(const std::vector<SeamOffset>& offsets, int steps, PatchLattice& surface) {
  if (offsets.empty() || steps == 0) return;
  std::vector<int32_t> ring_of_node(surface.depth.size(), 0);  // 0: not reached, 1: on the seam
  std::vector<std::pair<int32_t, Eigen::Vector3f>> ring;
  std::vector<int32_t> entry_of_node(surface.depth.size(), 0);  // position in its ring, where it has one
  for (const SeamOffset& seam : offsets) {
    const auto node = static_cast<size_t>(seam.node);
    if (ring_of_node[node] != 0) continue;  // several vertices in one patch: the first one speaks
    ring_of_node[node] = 1;
    entry_of_node[node] = static_cast<int32_t>(ring.size());
    ring.emplace_back(seam.node, seam.color);
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
  std::vector<std::pair<int32_t, Eigen::Vector3f>> next_ring;
  for (int32_t k = 1; k <= steps; ++k) {
    next_ring.clear();
    for (const auto& [node, offset] : ring) {
      for_each_linked(node, [&](int32_t neighbour) {
        auto& reached = ring_of_node[static_cast<size_t>(neighbour)];
        if (reached != 0) return;
        reached = k + 1;
        entry_of_node[static_cast<size_t>(neighbour)] = static_cast<int32_t>(next_ring.size());
        next_ring.emplace_back(neighbour, Eigen::Vector3f::Zero());
      });
    }
    for (auto& entry : next_ring) {
      Eigen::Vector3f sum = Eigen::Vector3f::Zero();
      float weight = 0;
      for_each_linked(entry.first, [&](int32_t neighbour) {
        if (ring_of_node[static_cast<size_t>(neighbour)] != k) return;
        sum += ring[static_cast<size_t>(entry_of_node[static_cast<size_t>(neighbour)])].second;
        weight += 1;
      });
      entry.second = sum / weight;
    }
    const float fade = static_cast<float>(steps + 1 - k) / static_cast<float>(steps);
    for (const auto& [node, offset] : ring) AddTo(surface.rgb[static_cast<size_t>(node)], offset * fade);
    std::swap(ring, next_ring);
  }
}

}  // namespace meshwright
