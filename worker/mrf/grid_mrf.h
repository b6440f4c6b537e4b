// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

namespace meshwright {

// Energy of a labelling x of a 4-connected grid with few labels per node (Jancosek, Shekhovtsov, Pajdla 2009, sec. 3.7,
// equation 1):
//
//   E(x) = sum_s theta_s(x_s) + sum_{st} theta_st(x_s, x_t)
//
//   theta_s(0) = label0_cost          theta_s(i)     = patch_cost[first_patch[s] + i - 1]
//   theta_st(0, 0) = 0                theta_st(0, i) = theta_st(i, 0) = boundary_cost
//   theta_st(i, j) = pairwise(patch i of s, patch j of t), +infinity allowed
//
// Label 0 says "no patch here", label i > 0 the node's i-th patch. Node s = row * columns + column has
// first_patch[s + 1] - first_patch[s] patches; a node without any can only take label 0. Costs have no unit.
// Everything at label 0 costs label0_cost per node, so the smallest energy is always finite.
struct GridMrf {
  // Most patches that one node may have.
  static constexpr int kMaxPatches = 254;

  int columns = 0;
  int rows = 0;
  std::vector<int32_t> first_patch;  // columns * rows + 1 entries, begins with 0, does not decrease
  std::vector<float> patch_cost;     // one per patch, finite
  float label0_cost = 1.0F;          // c0 of the paper
  float boundary_cost = 1.0F;        // e0 of the paper, >= 0
  // Cost of two patches (positions in patch_cost) on horizontally or vertically adjacent nodes, the upper or left node
  // first: finite or +infinity, never NaN. Called from several threads at once, a few times per pair.
  std::function<float(int32_t patch_s, int32_t patch_t)> pairwise;

  int NodeCount() const { return columns * rows; }
  int PatchCount(int node) const { return first_patch[node + 1] - first_patch[node]; }
};

// Aborts when the arrays' sizes do not fit each other.
void CheckGridMrf(const GridMrf& mrf);

// E(x), straight from the definition; labels[s] in [0, PatchCount(s)].
double MrfEnergy(const GridMrf& mrf, const std::vector<uint8_t>& labels);

}  // namespace meshwright
