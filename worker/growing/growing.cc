// SPDX-License-Identifier: Apache-2.0
#include "worker/growing/growing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <string>

#include "common/base/check.h"
#include "common/base/out_of_range.h"
#include "worker/growing/open_queue.h"

namespace meshwright {
namespace {

// Patches expanded between two rounds of insertions. Fixed, so that the result is a function of the data alone; small
// beside the front of a growing surface, so that the order stays best first; large enough to keep cores busy.
constexpr int kBatch = 256;
constexpr int kPiece = 16;

constexpr std::array<std::array<int, 2>, 4> kNeighbours = {{{1, 0}, {0, 1}, {-1, 0}, {0, -1}}};

// What expansion proposes for one neighbouring ray.
struct Candidate {
  bool proposed = false;
  GrownPatch patch;
};

class Grower {
 public:
  Grower(const PatchScorer& scorer, const AcceptedDepth& accepted, const GrowingOptions& options, ThreadPool& pool)
      : scorer_(scorer), accepted_(accepted), options_(options), pool_(pool) {
    stacks_.lattice = accepted.lattice;
    stacks_.first.assign(static_cast<size_t>(accepted.lattice.nodes()), -1);
    MakeNormalOffsets();
  }

  PatchStacks Run(const std::vector<Seed>& seeds) {
    InsertSeeds(seeds);
    std::vector<int32_t> batch;
    std::vector<std::array<Candidate, 4>> proposals(kBatch);
    std::vector<int64_t> scored(kBatch);
    while (open_.Pop(kBatch, batch)) {
      pool_.ParallelFor(static_cast<int64_t>(batch.size()), kPiece, [&](int64_t begin, int64_t end) {
        for (int64_t i = begin; i < end; ++i) {
          const auto slot = static_cast<size_t>(i);
          scored[slot] = Expand(stacks_.patches[static_cast<size_t>(batch[slot])], proposals[slot]);
        }
      });
      for (size_t i = 0; i < batch.size(); ++i) {
        stacks_.tentative_patches_scored += scored[i];
        for (const Candidate& candidate : proposals[i]) {
          if (candidate.proposed && PassesTests(candidate.patch)) Insert(candidate.patch);
        }
      }
    }
    return std::move(stacks_);
  }

 private:
  void InsertSeeds(const std::vector<Seed>& seeds) {
    // The best seeds first, so that condition (4) keeps the better of two on the same surface.
    std::vector<int32_t> order(seeds.size());
    for (size_t i = 0; i < order.size(); ++i) order[i] = static_cast<int32_t>(i);
    std::stable_sort(order.begin(), order.end(), [&](int32_t a, int32_t b) {
      return seeds[static_cast<size_t>(a)].quality > seeds[static_cast<size_t>(b)].quality;
    });
    for (const int32_t i : order) {
      const Seed& seed = seeds[static_cast<size_t>(i)];
      const GrownPatch patch{seed.plane, seed.quality, seed.sigma, i, seed.node, -1};
      if (!IsBehindAccepted(patch.node, patch.plane.w) && PassesTests(patch)) Insert(patch);
    }
  }

  // The 3 x 4 tentative patches of section 3.6: on each of the four neighbouring rays the patch of best quality among
  // the intersection with p's plane and one step before and behind. Reads the stacks, changes nothing. Returns how many
  // tentative patches were scored.
  int64_t Expand(const GrownPatch& p, std::array<Candidate, 4>& candidates) const {
    int64_t scored = 0;
    const Lattice& lattice = stacks_.lattice;
    const int column = p.node % lattice.columns;
    const int row = p.node / lattice.columns;
    bool have_slope = false;
    PatchPlane fitted;
    for (size_t j = 0; j < kNeighbours.size(); ++j) {
      Candidate& candidate = candidates[j];
      candidate.proposed = false;
      const int next_column = column + kNeighbours[j][0];
      const int next_row = row + kNeighbours[j][1];
      if (!lattice.Contains(next_column, next_row)) continue;
      const auto node = static_cast<int32_t>(lattice.Index(next_column, next_row));
      const PatchPlane on_plane = p.plane.MovedBy(static_cast<float>(kNeighbours[j][0] * lattice.step),
                                                  static_cast<float>(kNeighbours[j][1] * lattice.step));
      if (!(on_plane.w > 0) || !MayGrowAt(node, p.seed, on_plane.w)) continue;
      if (IsBehindAccepted(node, on_plane.w)) continue;
      const int x = lattice.PixelX(next_column);
      const int y = lattice.PixelY(next_row);
      PatchScorer::Window window;
      scorer_.MakeWindow(x, y, window);
      if (!window.usable) continue;
      if (!have_slope) {
        fitted = FitSlope(p, column, row);
        have_slope = true;
      }
      const float step = InverseDepthStep(scorer_.reference(), lattice.step, on_plane.w);
      std::array<float, 3> q{};
      for (int k = -1; k <= 1; ++k) {
        const PatchPlane tentative{on_plane.w - static_cast<float>(k) * step, fitted.gx, fitted.gy};
        q[static_cast<size_t>(k + 1)] = scorer_.MeanScore(window, x, y, tentative, p.sigma);
        ++scored;
      }
      int best = 1;
      if (q[0] > q[1]) best = 0;
      if (q[2] > q[static_cast<size_t>(best)]) best = 2;
      float offset = static_cast<float>(best - 1);
      // Sub-step depth: the peak of the parabola through the three scores.
      const float curvature = q[0] - 2 * q[1] + q[2];
      if (best == 1 && q[0] > PatchScorer::kNoScore && q[2] > PatchScorer::kNoScore && curvature < -1e-6F) {
        offset = std::clamp(0.5F * (q[0] - q[2]) / curvature, -0.5F, 0.5F);
      }
      candidate.patch = {
          {on_plane.w - offset * step, fitted.gx, fitted.gy}, q[static_cast<size_t>(best)], p.sigma, p.seed, node, -1};
      if (candidate.patch.quality <= static_cast<float>(options_.min_quality)) {
        scored += 3;
        if (!ChooseTargetsAnew(window, x, y, {on_plane.w, fitted.gx, fitted.gy}, step, candidate.patch)) continue;
      }
      candidate.proposed = !IsBehindAccepted(node, candidate.patch.plane.w);
    }
    return scored;
  }

  // Ours: where Sigma, which the paper hands on from the seed, does not see the surface any more, it goes on in the
  // targets that do: those that agree with the best of the three tentative patches around `plane`, several of them,
  // and better than Sigma had to, for the surface may have ended. Sets depth, quality and Sigma of `patch`.
  bool ChooseTargetsAnew(const PatchScorer::Window& window, int x, int y, const PatchPlane& plane, float step,
                         GrownPatch& patch) const {
    patch.quality = 0;
    for (int k = -1; k <= 1; ++k) {
      const PatchPlane tentative{plane.w - static_cast<float>(k) * step, plane.gx, plane.gy};
      std::array<float, 32> score{};
      float most = PatchScorer::kNoScore;
      for (int target = 0; target < scorer_.targets(); ++target) {
        float& q = score[static_cast<size_t>(target)];
        q = PatchScorer::kNoScore;
        const float moved_px = step * scorer_.PixelsPerInverseDepth(x, y, plane.w, target);
        if (moved_px < kMinMovement * static_cast<float>(stacks_.lattice.step)) continue;
        q = scorer_.Score(window, x, y, tentative, target);
        most = std::max(most, q);
      }
      const float least = std::max(kMinQualityAnew, most - kMaxDeficitAnew);
      float sum = 0;
      int count = 0;
      uint32_t sigma = 0;
      for (int target = 0; target < scorer_.targets(); ++target) {
        const float q = score[static_cast<size_t>(target)];
        if (q < least) continue;
        sum += q;
        ++count;
        sigma |= uint32_t{1} << target;
      }
      if (count < kMinTargetsAnew || sum <= static_cast<float>(count) * patch.quality) continue;
      patch.plane = tentative;
      patch.quality = sum / static_cast<float>(count);
      patch.sigma = sigma;
    }
    return patch.quality > 0;
  }

  // Conditions that need no score: (1) nothing of this seed on the ray yet, (4) nothing within d_r, (5) room.
  bool MayGrowAt(int32_t node, int32_t seed, float w) const {
    int count = 0;
    const float step = InverseDepthStep(scorer_.reference(), stacks_.lattice.step, w);
    for (int32_t i = stacks_.first[static_cast<size_t>(node)]; i >= 0;) {
      const GrownPatch& other = stacks_.patches[static_cast<size_t>(i)];
      if (other.seed == seed || std::fabs(other.plane.w - w) < step) return false;
      ++count;
      i = other.next;
    }
    return count < options_.max_patches_per_ray;
  }

  // Conditions (1), (2), (4), (5) of section 3.6, as the stacks are now.
  bool PassesTests(const GrownPatch& patch) const {
    if (!MayGrowAt(patch.node, patch.seed, patch.plane.w)) return false;
    float best_on_ray = -1;
    for (int32_t i = stacks_.first[static_cast<size_t>(patch.node)]; i >= 0;) {
      best_on_ray = std::max(best_on_ray, stacks_.patches[static_cast<size_t>(i)].quality);
      i = stacks_.patches[static_cast<size_t>(i)].next;
    }
    return patch.quality > best_on_ray - static_cast<float>(options_.max_quality_deficit);
  }

  // Condition (3). The paper lets a patch of higher quality grow behind an accepted one; where the surface is accepted,
  // that would grow about half of it once more for nothing, so whatever lies in its ball or behind it stops here.
  bool IsBehindAccepted(int32_t node, float w) const {
    const float depth = accepted_.depth[static_cast<size_t>(node)];
    if (!(depth > 0)) return false;
    const float w_accepted = 1.0F / depth;
    const float step = InverseDepthStep(scorer_.reference(), stacks_.lattice.step, w_accepted);
    return w < w_accepted + kAcceptedBallSteps * step;
  }

  void Insert(GrownPatch patch) {
    const auto index = static_cast<int32_t>(stacks_.patches.size());
    int32_t& first = stacks_.first[static_cast<size_t>(patch.node)];
    patch.next = first;
    first = index;
    open_.Push(index, patch.quality);
    stacks_.patches.push_back(patch);
  }

  // Normals: the least-squares plane through centres grown from the same seed. The plane is fitted in inverse depth
  // over pixels, where it is affine; p's own slope takes part as a weak prior, so that few or collinear neighbours are
  // no special case.
  PatchPlane FitSlope(const GrownPatch& p, int column, int row) const {
    const Lattice& lattice = stacks_.lattice;
    const float reach = static_cast<float>(options_.normal_radius_steps) *
                        InverseDepthStep(scorer_.reference(), lattice.step, p.plane.w);
    float sxx = kSlopePrior;
    float sxy = 0;
    float syy = kSlopePrior;
    float sx = kSlopePrior * p.plane.gx * static_cast<float>(lattice.step);
    float sy = kSlopePrior * p.plane.gy * static_cast<float>(lattice.step);
    for (const auto& offset : normal_offsets_) {
      const int c = column + offset[0];
      const int r = row + offset[1];
      if (!lattice.Contains(c, r)) continue;
      for (int32_t i = stacks_.first[static_cast<size_t>(lattice.Index(c, r))]; i >= 0;) {
        const GrownPatch& other = stacks_.patches[static_cast<size_t>(i)];
        i = other.next;
        if (other.seed != p.seed) continue;
        const float difference = other.plane.w - p.plane.w;
        if (std::fabs(difference) > reach) break;
        const auto dx = static_cast<float>(offset[0]);
        const auto dy = static_cast<float>(offset[1]);
        sxx += dx * dx;
        sxy += dx * dy;
        syy += dy * dy;
        sx += dx * difference;
        sy += dy * difference;
        break;
      }
    }
    const float determinant = sxx * syy - sxy * sxy;
    const float scale = 1.0F / (determinant * static_cast<float>(lattice.step));
    return {p.plane.w, (syy * sx - sxy * sy) * scale, (sxx * sy - sxy * sx) * scale};
  }

  // All nodes of the inner rings, and a thinner pattern further out: the fit hardly changes, the cost does.
  void MakeNormalOffsets() {
    const int radius = static_cast<int>(options_.normal_radius_steps);
    for (int dy = -radius; dy <= radius; ++dy) {
      for (int dx = -radius; dx <= radius; ++dx) {
        const int squared = dx * dx + dy * dy;
        if (squared == 0 || squared > radius * radius) continue;
        const bool inner = std::max(std::abs(dx), std::abs(dy)) <= 2;
        const bool thinned = dx % 3 == 0 && dy % 3 == 0;
        if (inner || thinned) normal_offsets_.push_back({dx, dy});
      }
    }
  }

  // Targets chosen anew: how many, their least NCC, how far below the best of them, and how far one step in depth has
  // to move the patch in them (3 degrees of apical angle), px per px of the lattice's step.
  static constexpr int kMinTargetsAnew = 2;
  static constexpr float kMinQualityAnew = 0.75F;
  static constexpr float kMaxDeficitAnew = 0.25F;
  static constexpr float kMinMovement = 0.05F;
  static constexpr float kSlopePrior = 2.0F;         // weight of p's slope, in squared lattice steps
  static constexpr float kAcceptedBallSteps = 3.0F;  // an accepted patch this near already is this surface

  const PatchScorer& scorer_;
  const AcceptedDepth& accepted_;
  const GrowingOptions& options_;
  ThreadPool& pool_;
  PatchStacks stacks_;
  OpenQueue open_;
  std::vector<std::array<int, 2>> normal_offsets_;  // lattice steps
};

}  // namespace

absl::Status GrowingOptions::Validate() const {
  if (!(min_quality >= -1 && min_quality <= 1)) return OutOfRange("growing.min_quality", min_quality, "-1..1");
  if (!(max_quality_deficit >= 0 && max_quality_deficit <= 2)) {
    return OutOfRange("growing.max_quality_deficit", max_quality_deficit, "0..2");
  }
  if (max_patches_per_ray < 1 || max_patches_per_ray > 32) {
    return OutOfRange("growing.max_patches_per_ray", max_patches_per_ray, "1..32");
  }
  if (!(normal_radius_steps >= 1 && normal_radius_steps <= 16)) {
    return OutOfRange("growing.normal_radius_steps", normal_radius_steps, "1..16");
  }
  return absl::OkStatus();
}

int64_t PatchStacks::CountRays() const {
  return std::count_if(first.begin(), first.end(), [](int32_t i) { return i >= 0; });
}

float InverseDepthStep(const Camera& reference, int lattice_step, float inverse_depth) {
  return inverse_depth * static_cast<float>(lattice_step) / static_cast<float>(reference.focal());
}

PatchStacks Grow(const PatchScorer& scorer, const std::vector<Seed>& seeds, const AcceptedDepth& accepted,
                 const GrowingOptions& options, ThreadPool& pool) {
  return Grower(scorer, accepted, options, pool).Run(seeds);
}

}  // namespace meshwright
