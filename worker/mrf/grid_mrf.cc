// SPDX-License-Identifier: Apache-2.0
#include "worker/mrf/grid_mrf.h"

#include "common/base/check.h"

namespace meshwright {
namespace {

double EdgeCost(const GridMrf& mrf, const std::vector<uint8_t>& labels, int s, int t) {
  if (labels[s] == 0 && labels[t] == 0) return 0.0;
  if (labels[s] == 0 || labels[t] == 0) return mrf.boundary_cost;
  return mrf.pairwise(mrf.first_patch[s] + labels[s] - 1, mrf.first_patch[t] + labels[t] - 1);
}

}  // namespace

void CheckGridMrf(const GridMrf& mrf) {
  MW_CHECK(mrf.columns >= 0 && mrf.rows >= 0);
  MW_CHECK(mrf.first_patch.size() == static_cast<size_t>(mrf.NodeCount()) + 1);
  MW_CHECK(mrf.first_patch.front() == 0);
  MW_CHECK(mrf.first_patch.back() == static_cast<int64_t>(mrf.patch_cost.size()));
  MW_CHECK(mrf.boundary_cost >= 0.0F);
  MW_CHECK(mrf.patch_cost.empty() || mrf.pairwise != nullptr);
  for (int node = 0; node < mrf.NodeCount(); ++node) {
    MW_CHECK(mrf.PatchCount(node) >= 0 && mrf.PatchCount(node) <= GridMrf::kMaxPatches);
  }
}

double MrfEnergy(const GridMrf& mrf, const std::vector<uint8_t>& labels) {
  MW_CHECK(labels.size() == static_cast<size_t>(mrf.NodeCount()));
  double energy = 0.0;
  for (int node = 0; node < mrf.NodeCount(); ++node) {
    energy += labels[node] == 0 ? mrf.label0_cost : mrf.patch_cost[mrf.first_patch[node] + labels[node] - 1];
    if ((node + 1) % mrf.columns != 0) energy += EdgeCost(mrf, labels, node, node + 1);
    if (node + mrf.columns < mrf.NodeCount()) energy += EdgeCost(mrf, labels, node, node + mrf.columns);
  }
  return energy;
}

}  // namespace meshwright
