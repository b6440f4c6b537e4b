// SPDX-License-Identifier: Apache-2.0
#include "worker/seeding/corner_seeds.h"

#include <algorithm>
#include <array>
#include <bit>
#include <optional>
#include <utility>

#include <Eigen/Core>

#include "worker/seeding/corner_matcher.h"
#include "worker/seeding/harris.h"
#include "worker/seeding/pixel_index.h"
#include "worker/seeding/plane_search.h"

namespace meshwright {
namespace {

constexpr int kKnownCellSize = 32;        // px, of the index of known seeds
constexpr int kMaxKnown = 2;              // known seeds nearby that are tried
constexpr float kMaxKnownDistance = 48;   // px to them
constexpr float kMinContinuedNcc = 0.6F;  // with which a known seed's plane is taken to go on to a corner
constexpr size_t kMaxHypotheses = 3;      // of a corner, refined
constexpr int kReach = 1;                 // px
constexpr float kFirstStep = 0.5F;        // px
constexpr int kRounds = 2;
constexpr int kMinContinued = 2;  // windows beside a seed's that must match too
// A seed with so many targets (or all that can measure it, at least 2) and such a quality ends the search at its
// corner.
constexpr int kConvincingTargets = 3;
constexpr float kConvincingQuality = 0.85F;
// Seeds of a corner that fall behind its best by more are left out, like patches in growing (section 3.6); so are those
// that fewer than half as many targets see.
constexpr float kMaxBehindBest = 0.1F;
// A seed that one target alone confirms: what its NCC must reach, and by how much it must exceed any rival match.
constexpr float kMinLoneNcc = 0.85F;
constexpr float kMinLead = 0.15F;
constexpr int64_t kGrain = 32;  // corners

// Seeds by their place in the reference's image.
class KnownSeeds {
 public:
  KnownSeeds(const std::vector<Seed>& seeds, const Lattice& lattice) : seeds_(seeds), index_(Index(seeds, lattice)) {}

  // Known seeds near a pixel, nearest first, their planes moved to its centre.
  std::vector<Seed> Near(int x, int y) const {
    const Eigen::Vector2f place(static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F);
    std::vector<Seed> near;
    for (const int32_t i : index_.FindNearest(place, kMaxKnown, kMaxKnownDistance)) {
      near.push_back(seeds_[static_cast<size_t>(i)]);
      const Eigen::Vector2f d = place - index_.point(i);
      near.back().plane = near.back().plane.MovedBy(d.x(), d.y());
    }
    return near;
  }

 private:
  static PixelIndex Index(const std::vector<Seed>& seeds, const Lattice& lattice) {
    std::vector<Eigen::Vector2f> pixels;
    pixels.reserve(seeds.size());
    for (const Seed& seed : seeds) {
      pixels.push_back(lattice.Pixel(seed.node % lattice.columns, seed.node / lattice.columns).cast<float>());
    }
    return {lattice.step * lattice.columns, lattice.step * lattice.rows, kKnownCellSize, std::move(pixels)};
  }

  const std::vector<Seed>& seeds_;
  PixelIndex index_;
};

RelativeSlope SlopeOf(const PatchPlane& plane) { return RelativeSlope(plane.gx, plane.gy) / plane.w; }

bool IsConvincing(const SeedFitter& fitter, const SeedFitter::Node& node, const Seed& seed) {
  if (seed.quality < kConvincingQuality) return false;
  const int targets = std::popcount(seed.sigma);
  return targets >= kConvincingTargets ||
         (targets >= 2 && targets == std::popcount(fitter.TargetsFor(node.x, node.y, seed.plane.w)));
}

// The seed that a known one's plane leads to, when the corner is convincingly on it: much cheaper than matching.
std::optional<Seed> SeedFromKnown(const SeedFitter& fitter, const SeedFitter::Node& node,
                                  const std::vector<Seed>& near) {
  for (const Seed& known : near) {
    if (!(known.plane.w > 0) || !node.window.usable) continue;
    const uint32_t targets = known.sigma & fitter.TargetsFor(node.x, node.y, known.plane.w);
    if (targets == 0) continue;
    const PatchObjective objective(fitter.scorer(), node.window, node.x, node.y, targets);
    const ScoredPlane found = SearchDepth(objective, known.plane.w, SlopeOf(known.plane), kReach);
    if (found.score < kMinContinuedNcc) continue;
    Seed seed;
    if (fitter.Fit(node, found.plane, kMinContinued, seed) == SeedFitter::Outcome::kSeed &&
        IsConvincing(fitter, node, seed)) {
      return seed;
    }
  }
  return std::nullopt;
}

// Whether no other hypothesis comes near the quality of hypothesis i's seed.
bool StandsAlone(const Seed& seed, const std::vector<CornerHypothesis>& hypotheses, size_t i) {
  if (seed.quality < kMinLoneNcc) return false;
  for (size_t k = 0; k < hypotheses.size(); ++k) {
    if (k != i && hypotheses[k].best.ncc > seed.quality - kMinLead) return false;
  }
  return true;
}

std::vector<Seed> SeedFromMatches(const SeedFitter& fitter, const CornerMatcher& matcher, const Corner& corner,
                                  const SeedFitter::Node& node, const std::vector<Seed>& near) {
  const PatchScorer& scorer = fitter.scorer();
  PatchScorer::Window window;
  scorer.MakeWindow(corner.x, corner.y, window);
  if (!window.usable) return {};
  std::optional<RelativeSlope> prior;
  if (!near.empty() && near[0].plane.w > 0) prior = SlopeOf(near[0].plane);
  const std::vector<CornerHypothesis> hypotheses =
      matcher.Match(corner, window, fitter.MinInverseDepth(node.index), prior);

  std::vector<Seed> found;
  int most_targets = 0;
  float best_quality = 0;
  for (size_t i = 0; i < std::min(hypotheses.size(), kMaxHypotheses); ++i) {
    const CornerMatch& best = hypotheses[i].best;
    const PatchObjective pair(scorer, window, corner.x, corner.y, 1U << best.target);
    const ScoredPlane in_depth = SearchDepth(pair, best.plane.w, SlopeOf(best.plane), kReach);
    const PatchPlane plane = RefinePlane(pair, in_depth, kFirstStep, kRounds).plane;
    const PatchPlane at_node =
        plane.MovedBy(static_cast<float>(node.x - corner.x), static_cast<float>(node.y - corner.y));
    Seed seed;
    if (fitter.Fit(node, at_node, kMinContinued, seed) != SeedFitter::Outcome::kSeed) continue;
    const int targets = std::popcount(seed.sigma);
    if (targets == 1 && !StandsAlone(seed, hypotheses, i)) continue;
    found.push_back(seed);
    most_targets = std::max(most_targets, targets);
    best_quality = std::max(best_quality, seed.quality);
    if (IsConvincing(fitter, node, seed)) break;
  }
  std::erase_if(found, [&](const Seed& seed) {
    return seed.quality <= best_quality - kMaxBehindBest || 2 * std::popcount(seed.sigma) < most_targets;
  });
  return found;
}

// What a run of corners gave.
struct Piece {
  std::vector<Seed> seeds;
  std::vector<uint32_t> covered;  // targets that agree with the accepted surface, of corners that it explains
};

void SeedCorner(const SeedFitter& fitter, const CornerMatcher& matcher, const KnownSeeds& known, const Corner& corner,
                Piece& piece) {
  const SeedFitter::Node node = fitter.NodeAt(corner.x, corner.y);
  if (const auto accepted = fitter.AcceptedPlane(node.index)) {
    float sum = 0;
    const uint32_t measurable = fitter.TargetsFor(node.x, node.y, accepted->w);
    const uint32_t agreeing = fitter.TargetsThatAgree(node, *accepted, measurable, kMinTargetNcc, sum);
    if (agreeing != 0) {
      piece.covered.push_back(agreeing);
      return;
    }
  }
  const std::vector<Seed> near = known.Near(node.x, node.y);
  if (const auto seed = SeedFromKnown(fitter, node, near)) {
    piece.seeds.push_back(*seed);
    return;
  }
  const std::vector<Seed> found = SeedFromMatches(fitter, matcher, corner, node, near);
  piece.seeds.insert(piece.seeds.end(), found.begin(), found.end());
}

}  // namespace

CornerSeeds SeedCorners(const SeedFitter& fitter, const std::vector<Seed>& known, double min_w, double max_w,
                        const Lattice& lattice, ThreadPool& pool) {
  CornerSeeds result;
  result.covered_matches_per_target.assign(static_cast<size_t>(fitter.scorer().targets()), 0);
  const CornerMatcher matcher(fitter, min_w, max_w, pool);
  const HarrisOptions harris;
  const std::vector<Corner> corners = DetectHarrisCorners(fitter.scorer().reference_image(), harris, pool);
  result.corners = static_cast<int64_t>(corners.size());

  // The strongest corner of each cell goes first: the others mostly lie on the surfaces that these find.
  std::array<std::vector<Corner>, 2> passes;
  for (size_t i = 0; i < corners.size(); ++i) {
    const bool first_of_cell = i == 0 || corners[i].x / harris.cell_size != corners[i - 1].x / harris.cell_size ||
                               corners[i].y / harris.cell_size != corners[i - 1].y / harris.cell_size;
    passes[first_of_cell ? 0 : 1].push_back(corners[i]);
  }
  std::vector<Seed> all_known = known;
  for (const std::vector<Corner>& pass : passes) {
    const KnownSeeds known_seeds(all_known, lattice);
    const auto count = static_cast<int64_t>(pass.size());
    std::vector<Piece> pieces(static_cast<size_t>((count + kGrain - 1) / kGrain));
    pool.ParallelFor(count, kGrain, [&](int64_t begin, int64_t end) {
      Piece& piece = pieces[static_cast<size_t>(begin / kGrain)];
      for (int64_t i = begin; i < end; ++i) {
        SeedCorner(fitter, matcher, known_seeds, pass[static_cast<size_t>(i)], piece);
      }
    });
    std::vector<Seed> found;
    for (const Piece& piece : pieces) {
      found.insert(found.end(), piece.seeds.begin(), piece.seeds.end());
      result.covered_corners += static_cast<int64_t>(piece.covered.size());
      for (const uint32_t agreeing : piece.covered) {
        for (size_t t = 0; t < result.covered_matches_per_target.size(); ++t) {
          result.covered_matches_per_target[t] += agreeing >> t & 1U;
        }
      }
    }
    result.seeds.insert(result.seeds.end(), found.begin(), found.end());
    all_known.insert(all_known.end(), found.begin(), found.end());
  }
  return result;
}

}  // namespace meshwright
