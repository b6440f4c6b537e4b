// SPDX-License-Identifier: Apache-2.0
#include "worker/filtering/filtering.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "common/base/out_of_range.h"
#include "common/base/status_macros.h"

namespace meshwright {
namespace {

constexpr int kPatchesPerPiece = 4096;

// theta_st(i, j) for two patches on neighbouring rays. The paper takes the distance of their centres; at grazing angles
// neighbours on one plane are far apart, so each patch's distance from the other's plane is taken instead.
class PairwiseCost {
 public:
  PairwiseCost(const PatchStacks& stacks, const std::vector<int32_t>& order, const Camera& reference,
               const FilteringOptions& options, ThreadPool& pool)
      : stacks_(stacks),
        reference_(reference),
        min_cosine_(static_cast<float>(std::cos(options.max_normal_angle_deg * std::numbers::pi / 180))),
        max_steps_(static_cast<float>(options.max_plane_distance_steps)),
        patches_(order.size()) {
    pool.ParallelFor(static_cast<int64_t>(order.size()), kPatchesPerPiece, [&](int64_t begin, int64_t end) {
      for (int64_t i = begin; i < end; ++i) {
        patches_[static_cast<size_t>(i)] = Describe(stacks.patches[static_cast<size_t>(order[static_cast<size_t>(i)])]);
      }
    });
  }

  // Infinite when the two cannot be one surface.
  float operator()(int32_t s, int32_t t) const {
    const Described& a = patches_[static_cast<size_t>(s)];
    const Described& b = patches_[static_cast<size_t>(t)];
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    if (!(a.normal.dot(b.normal) > min_cosine_)) return kInfinity;
    const auto dx = static_cast<float>(b.x - a.x);
    const auto dy = static_cast<float>(b.y - a.y);
    // Along the ray, in units of d_r at the closer patch; times the cosine it is the distance from the plane.
    const float step = InverseDepthStep(reference_, stacks_.lattice.step, std::max(a.plane.w, b.plane.w));
    const float b_from_a = std::fabs(b.plane.w - a.plane.MovedBy(dx, dy).w) * a.cosine;
    const float a_from_b = std::fabs(a.plane.w - b.plane.MovedBy(-dx, -dy).w) * b.cosine;
    const float delta = 0.5F * (b_from_a + a_from_b) / (step * max_steps_);
    return delta <= 1.0F ? delta : kInfinity;
  }

 private:
  struct Described {
    PatchPlane plane;
    Eigen::Vector3f normal;  // reference camera's frame
    float cosine = 0;        // between normal and ray
    int x = 0;               // px
    int y = 0;
  };

  Described Describe(const GrownPatch& patch) const {
    Described described;
    described.plane = patch.plane;
    described.x = stacks_.lattice.PixelX(patch.node % stacks_.lattice.columns);
    described.y = stacks_.lattice.PixelY(patch.node / stacks_.lattice.columns);
    const Eigen::Vector3d normal = NormalInCam(reference_, described.x + 0.5, described.y + 0.5, patch.plane);
    const Eigen::Vector3d ray = reference_.RayInCam(described.x + 0.5, described.y + 0.5).normalized();
    described.normal = normal.cast<float>();
    described.cosine = static_cast<float>(std::fabs(normal.dot(ray)));
    return described;
  }

  const PatchStacks& stacks_;
  const Camera& reference_;
  float min_cosine_;
  float max_steps_;
  std::vector<Described> patches_;
};

// Patches in the order of nodes, those of a node by inverse depth: labels that do not depend on the order of growing.
std::vector<int32_t> OrderByNode(const PatchStacks& stacks, std::vector<int32_t>& first_patch) {
  std::vector<int32_t> order;
  order.reserve(stacks.patches.size());
  first_patch.assign(stacks.first.size() + 1, 0);
  for (size_t node = 0; node < stacks.first.size(); ++node) {
    const auto begin = order.size();
    for (int32_t i = stacks.first[node]; i >= 0; i = stacks.patches[static_cast<size_t>(i)].next) order.push_back(i);
    std::sort(order.begin() + static_cast<int64_t>(begin), order.end(), [&](int32_t a, int32_t b) {
      return stacks.patches[static_cast<size_t>(a)].plane.w > stacks.patches[static_cast<size_t>(b)].plane.w;
    });
    first_patch[node + 1] = static_cast<int32_t>(order.size());
  }
  return order;
}

}  // namespace

absl::Status FilteringOptions::Validate() const {
  if (!(no_patch_cost >= 0)) return OutOfRange("filtering.no_patch_cost", no_patch_cost, ">= 0");
  if (!(boundary_cost >= 0)) return OutOfRange("filtering.boundary_cost", boundary_cost, ">= 0");
  if (!(max_plane_distance_steps > 0))
    return OutOfRange("filtering.max_plane_distance_steps", max_plane_distance_steps, "> 0");
  if (!(max_normal_angle_deg >= 0 && max_normal_angle_deg <= 180)) {
    return OutOfRange("filtering.max_normal_angle_deg", max_normal_angle_deg, "0..180");
  }
  MW_RETURN_IF_ERROR(trws.Validate());
  return refinement.Validate();
}

FilteringResult FilterPatches(const PatchStacks& stacks, const Camera& reference, const FilteringOptions& options,
                              ThreadPool& pool) {
  GridMrf mrf;
  mrf.columns = stacks.lattice.columns;
  mrf.rows = stacks.lattice.rows;
  mrf.label0_cost = static_cast<float>(options.no_patch_cost);
  mrf.boundary_cost = static_cast<float>(options.boundary_cost);
  const std::vector<int32_t> order = OrderByNode(stacks, mrf.first_patch);
  mrf.patch_cost.reserve(order.size());
  for (const int32_t i : order) mrf.patch_cost.push_back(-0.5F * (stacks.patches[static_cast<size_t>(i)].quality + 1));
  const PairwiseCost cost(stacks, order, reference, options, pool);
  mrf.pairwise = [&cost](int32_t s, int32_t t) { return cost(s, t); };
  const MrfSolution solution = SolveInWindows(mrf, options.trws, pool);

  FilteringResult result{SurfaceEstimate(stacks.lattice), solution.energy, solution.lower_bound};
  const Lattice& lattice = stacks.lattice;
  const auto chosen = [&](int64_t node) {
    const auto i = static_cast<size_t>(node);
    return solution.labels[i] == 0 ? -1 : mrf.first_patch[i] + solution.labels[i] - 1;
  };
  for (int row = 0; row < lattice.rows; ++row) {
    for (int column = 0; column < lattice.columns; ++column) {
      const int64_t node = lattice.Index(column, row);
      const int32_t own = chosen(node);
      if (own < 0) continue;
      const auto i = static_cast<size_t>(node);
      const GrownPatch& patch = stacks.patches[static_cast<size_t>(order[static_cast<size_t>(own)])];
      result.surface.plane[i] = patch.plane;
      result.surface.quality[i] = patch.quality;
      result.surface.sigma[i] = patch.sigma;
      const int32_t right = column + 1 < lattice.columns ? chosen(node + 1) : -1;
      const int32_t below = row + 1 < lattice.rows ? chosen(node + lattice.columns) : -1;
      if (right >= 0 && std::isfinite(cost(own, right))) result.surface.links[i] |= PatchLattice::kLinkRight;
      if (below >= 0 && std::isfinite(cost(own, below))) result.surface.links[i] |= PatchLattice::kLinkDown;
    }
  }
  return result;
}

PatchLattice MakeFilteredSurface(const SurfaceEstimate& surface, CameraIndex reference_index, const Camera& reference,
                                 const ColorImage& color) {
  const Lattice& lattice = surface.lattice;
  PatchLattice filtered = PatchLattice::Empty(reference_index, reference, lattice.step);
  const Eigen::Matrix3d world_from_cam = reference.cam_from_world.rotation.transpose();
  for (int row = 0; row < lattice.rows; ++row) {
    for (int column = 0; column < lattice.columns; ++column) {
      const int64_t node = lattice.Index(column, row);
      if (!surface.HasPatch(node)) continue;
      const auto i = static_cast<size_t>(node);
      const int x = lattice.PixelX(column);
      const int y = lattice.PixelY(row);
      filtered.depth[i] = 1.0F / surface.plane[i].w;
      filtered.normal_in_world[i] =
          (world_from_cam * NormalInCam(reference, x + 0.5, y + 0.5, surface.plane[i])).cast<float>();
      filtered.quality[i] = surface.quality[i];
      filtered.rgb[i] = color.At(x, y);
      filtered.links[i] = surface.links[i];
    }
  }
  return filtered;
}

}  // namespace meshwright
