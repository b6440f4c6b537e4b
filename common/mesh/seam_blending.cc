// SPDX-License-Identifier: Apache-2.0
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

void BlendSeams(const std::vector<SeamOffset>& offsets, int steps, const SparseSurface& surface,
                std::vector<std::array<uint8_t, 3>>& colors) {
  if (offsets.empty() || steps == 0) return;
  std::vector<int32_t> ring_of_patch(surface.patches(), 0);  // 0: not reached, 1: on the seam
  std::vector<std::pair<int32_t, Eigen::Vector3f>> ring;
  std::vector<int32_t> entry_of_patch(surface.patches(), 0);  // position in its ring, where it has one
  for (const SeamOffset& seam : offsets) {
    const auto patch = static_cast<size_t>(seam.patch);
    if (ring_of_patch[patch] != 0) continue;  // several vertices in one patch: the first one speaks
    ring_of_patch[patch] = 1;
    entry_of_patch[patch] = static_cast<int32_t>(ring.size());
    ring.emplace_back(seam.patch, seam.color);
  }
  const PatchFinder finder(surface);
  const int32_t columns = surface.lattice.columns;
  const auto is_linked = [&](int32_t patch, uint8_t link) {
    return (surface.links[static_cast<size_t>(patch)] & link) != 0;
  };
  const auto for_each_linked = [&](int32_t patch, const auto& visit) {
    const int32_t node = surface.node[static_cast<size_t>(patch)];
    if (is_linked(patch, PatchLattice::kLinkRight)) visit(patch + 1);
    if (is_linked(patch, PatchLattice::kLinkDown)) visit(finder.At(node + columns));
    if (node % columns > 0 && finder.At(node - 1) >= 0 && is_linked(patch - 1, PatchLattice::kLinkRight)) {
      visit(patch - 1);
    }
    if (node >= columns) {
      const int32_t above = finder.At(node - columns);
      if (above >= 0 && is_linked(above, PatchLattice::kLinkDown)) visit(above);
    }
  };
  std::vector<std::pair<int32_t, Eigen::Vector3f>> next_ring;
  for (int32_t k = 1; k <= steps; ++k) {
    next_ring.clear();
    for (const auto& [patch, offset] : ring) {
      for_each_linked(patch, [&](int32_t neighbour) {
        auto& reached = ring_of_patch[static_cast<size_t>(neighbour)];
        if (reached != 0) return;
        reached = k + 1;
        entry_of_patch[static_cast<size_t>(neighbour)] = static_cast<int32_t>(next_ring.size());
        next_ring.emplace_back(neighbour, Eigen::Vector3f::Zero());
      });
    }
    for (auto& entry : next_ring) {
      Eigen::Vector3f sum = Eigen::Vector3f::Zero();
      float weight = 0;
      for_each_linked(entry.first, [&](int32_t neighbour) {
        if (ring_of_patch[static_cast<size_t>(neighbour)] != k) return;
        sum += ring[static_cast<size_t>(entry_of_patch[static_cast<size_t>(neighbour)])].second;
        weight += 1;
      });
      entry.second = sum / weight;
    }
    const float fade = static_cast<float>(steps + 1 - k) / static_cast<float>(steps);
    for (const auto& [patch, offset] : ring) AddTo(colors[static_cast<size_t>(patch)], offset * fade);
    std::swap(ring, next_ring);
  }
}

}  // namespace meshwright
