#include "worker/seeding/corner_seeds.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>
#include <tuple>

#include <Eigen/Core>

#include "worker/seeding/harris.h"
#include "worker/seeding/pixel_index.h"
#include "worker/seeding/plane_search.h"

namespace meshwright {
namespace {

constexpr int kCellSize = 16;            // px, of the indices of corners
constexpr double kEpipolarBand = 2;      // px: both corners are found to the pixel only
constexpr float kMaxKnownDistance = 48;  // px to a seed whose slope is tried
// NCC of a facing window below which a match is not looked at any further, and what its best slope must reach.
constexpr float kMinFirstNcc = 0.2F;
constexpr float kMinPairNcc = 0.5F;
// A window that matches so well needs no other slope.
constexpr float kGoodPairNcc = 0.8F;
// Matches in different targets whose depths differ by less than this in a target's image are one hypothesis.
constexpr float kSameDepthPx = 2;
constexpr size_t kMaxMatches = 64;      // of a corner, the best
constexpr size_t kMaxHypotheses = 4;    // of a corner, refined
constexpr int kPairReach = 1;           // px
constexpr float kPairFirstStep = 0.5F;  // px
constexpr int kPairRounds = 2;
constexpr int kMinContinued = 2;  // windows beside a seed's that must match too
// A seed with so many targets and such a quality ends the search at its corner.
constexpr int kConvincingTargets = 3;
constexpr float kConvincingQuality = 0.85F;
// Seeds of a corner that fall behind its best by more are left out, like patches in growing (section 3.6); so are those
// that fewer than half as many targets see.
constexpr float kMaxBehindBest = 0.1F;
// A seed that one target alone confirms: what its NCC must reach, and by how much it must exceed any rival match.
constexpr float kMinLoneNcc = 0.8F;
constexpr float kMinLead = 0.15F;

// A corner of a target that may show the reference's corner.
struct Match {
  PatchPlane plane;  // at the reference's corner
  float ncc = 0;
  int target = 0;
};

// Matches of one corner in several targets that agree on its depth.
struct Hypothesis {
  Match best;
  float support = 0;  // sum over targets of the best NCC
};

class CornerMatcher {
 public:
  CornerMatcher(const SeedFitter& fitter, const std::vector<Seed>& known, double min_w, double max_w,
                const Lattice& lattice, ThreadPool& pool)
      : fitter_(fitter),
        scorer_(fitter.scorer()),
        known_(known),
        min_w_(min_w),
        max_w_(max_w),
        known_index_(IndexKnown(known, lattice)) {
    for (int i = 0; i < scorer_.targets(); ++i) {
      const SamplingImage& image = *scorer_.target(i).grey;
      std::vector<Eigen::Vector2f> pixels;
      for (const Corner& corner : DetectHarrisCorners(image, {}, pool)) {
        pixels.emplace_back(static_cast<float>(corner.x) + 0.5F, static_cast<float>(corner.y) + 0.5F);
      }
      target_corners_.emplace_back(image.width(), image.height(), kCellSize, std::move(pixels));
    }
  }

  // Appends seeds. Returns the targets that agree with the accepted surface, if that explains the corner.
  uint32_t SeedCorner(const Corner& corner, std::vector<Seed>& seeds) const {
    const SeedFitter::Node node = fitter_.NodeAt(corner.x, corner.y);
    if (const auto accepted = fitter_.AcceptedPlane(node.index)) {
      float sum = 0;
      const uint32_t agreeing = fitter_.TargetsThatAgree(
          node, *accepted, fitter_.TargetsFor(node.x, node.y, accepted->w), kMinTargetNcc, sum);
      if (agreeing != 0) return agreeing;
    }
    PatchScorer::Window window;
    scorer_.MakeWindow(corner.x, corner.y, window);
    if (!window.usable) return 0;
    const std::vector<Match> matches = FindMatches(corner, window, node);
    const std::vector<Hypothesis> hypotheses = Group(corner, matches);
    std::vector<Seed> found;
    int most_targets = 0;
    float best_quality = 0;
    for (size_t i = 0; i < std::min(hypotheses.size(), kMaxHypotheses); ++i) {
      const Match& best = hypotheses[i].best;
      const PatchObjective pair(scorer_, window, corner.x, corner.y, 1U << best.target);
      const RelativeSlope slope(best.plane.gx / best.plane.w, best.plane.gy / best.plane.w);
      const ScoredPlane in_depth = SearchDepth(pair, best.plane.w, slope, kPairReach);
      const PatchPlane plane = RefinePlane(pair, in_depth, kPairFirstStep, kPairRounds).plane;
      Seed seed;
      const auto at_node = plane.MovedBy(static_cast<float>(node.x - corner.x), static_cast<float>(node.y - corner.y));
      if (fitter_.Fit(node, at_node, kMinContinued, seed) != SeedFitter::Outcome::kSeed) continue;
      const int targets = std::popcount(seed.sigma);
      if (targets == 1 && !StandsAlone(seed, hypotheses, i)) continue;
      found.push_back(seed);
      most_targets = std::max(most_targets, targets);
      best_quality = std::max(best_quality, seed.quality);
      if (targets >= kConvincingTargets && seed.quality >= kConvincingQuality) break;
    }
    for (const Seed& seed : found) {
      if (seed.quality > best_quality - kMaxBehindBest && 2 * std::popcount(seed.sigma) >= most_targets) {
        seeds.push_back(seed);
      }
    }
    return 0;
  }

 private:
  static PixelIndex IndexKnown(const std::vector<Seed>& known, const Lattice& lattice) {
    std::vector<Eigen::Vector2f> pixels;
    for (const Seed& seed : known) {
      pixels.push_back(lattice.Pixel(seed.node % lattice.columns, seed.node / lattice.columns).cast<float>());
    }
    return {lattice.step * lattice.columns, lattice.step * lattice.rows, 2 * kCellSize, std::move(pixels)};
  }

  std::vector<Match> FindMatches(const Corner& corner, const PatchScorer::Window& window,
                                 const SeedFitter::Node& node) const {
    const Camera& reference = scorer_.reference();
    const RelativeSlope facing = FacingSlope(reference, corner.x, corner.y);
    const std::array<RelativeSlope, 4> tilted = TiltedSlopes(reference, corner.x, corner.y);
    std::optional<RelativeSlope> prior;
    const auto near = known_index_.FindNearest(
        Eigen::Vector2f(static_cast<float>(corner.x), static_cast<float>(corner.y)), 1, kMaxKnownDistance);
    if (!near.empty()) {
      const PatchPlane& plane = known_[static_cast<size_t>(near[0])].plane;
      prior = RelativeSlope(plane.gx, plane.gy) / plane.w;
    }
    const double min_w = std::max(min_w_, static_cast<double>(fitter_.MinInverseDepth(node.index)));

    std::vector<Match> matches;
    std::vector<int32_t> found;
    for (int target = 0; target < scorer_.targets(); ++target) {
      const EpipolarSegment segment = fitter_.epipolar(target).SegmentOf(corner.x + 0.5, corner.y + 0.5, min_w, max_w_);
      if (segment.empty()) continue;
      const PixelIndex& corners = target_corners_[static_cast<size_t>(target)];
      corners.FindNearSegment(segment.Pixel(segment.min_w), segment.Pixel(segment.max_w), kEpipolarBand, found);
      for (const int32_t i : found) {
        const auto w = static_cast<float>(
            std::clamp(segment.InverseDepthBeside(corners.point(i).cast<double>()), segment.min_w, segment.max_w));
        Match match{{}, PatchScorer::kNoScore, target};
        const auto propose = [&](const RelativeSlope& slope) {
          const PatchPlane plane = PlaneWithSlope(w, slope);
          const float ncc = scorer_.Score(window, corner.x, corner.y, plane, target);
          if (ncc > match.ncc) {
            match.plane = plane;
            match.ncc = ncc;
          }
        };
        propose(facing);
        if (prior && match.ncc < kGoodPairNcc) propose(*prior);
        if (match.ncc < kMinFirstNcc) continue;
        if (match.ncc < kGoodPairNcc) {
          for (const RelativeSlope& slope : tilted) propose(slope);
        }
        if (match.ncc >= kMinPairNcc) matches.push_back(match);
      }
    }
    return matches;
  }

  std::vector<Hypothesis> Group(const Corner& corner, std::vector<Match> matches) const {
    std::sort(matches.begin(), matches.end(), [](const Match& a, const Match& b) {
      return std::tie(b.ncc, a.target, a.plane.w) < std::tie(a.ncc, b.target, b.plane.w);
    });
    if (matches.size() > kMaxMatches) matches.resize(kMaxMatches);
    std::vector<Hypothesis> hypotheses;
    std::vector<bool> taken(matches.size());
    for (size_t i = 0; i < matches.size(); ++i) {
      if (taken[i]) continue;
      Hypothesis hypothesis{matches[i], 0};
      uint32_t targets = 0;
      for (size_t k = i; k < matches.size(); ++k) {
        if (taken[k]) continue;
        const float px_per_w = scorer_.PixelsPerInverseDepth(corner.x, corner.y, matches[i].plane.w, matches[k].target);
        if (!(std::abs(matches[k].plane.w - matches[i].plane.w) * px_per_w <= kSameDepthPx)) continue;
        taken[k] = true;
        const uint32_t bit = 1U << matches[k].target;
        if ((targets & bit) == 0) hypothesis.support += matches[k].ncc;
        targets |= bit;
      }
      hypotheses.push_back(hypothesis);
    }
    std::stable_sort(hypotheses.begin(), hypotheses.end(),
                     [](const Hypothesis& a, const Hypothesis& b) { return a.support > b.support; });
    return hypotheses;
  }

  // Whether no other hypothesis comes near the quality of hypothesis i's seed.
  static bool StandsAlone(const Seed& seed, const std::vector<Hypothesis>& hypotheses, size_t i) {
    if (seed.quality < kMinLoneNcc) return false;
    for (size_t k = 0; k < hypotheses.size(); ++k) {
      if (k != i && hypotheses[k].best.ncc > seed.quality - kMinLead) return false;
    }
    return true;
  }

  const SeedFitter& fitter_;
  const PatchScorer& scorer_;
  const std::vector<Seed>& known_;
  double min_w_;
  double max_w_;
  PixelIndex known_index_;
  std::vector<PixelIndex> target_corners_;
};

}  // namespace

CornerSeeds SeedCorners(const SeedFitter& fitter, const std::vector<Seed>& known, double min_w, double max_w,
                        const Lattice& lattice, ThreadPool& pool) {
  CornerSeeds result;
  result.covered_matches_per_target.assign(static_cast<size_t>(fitter.scorer().targets()), 0);
  const CornerMatcher matcher(fitter, known, min_w, max_w, lattice, pool);
  const std::vector<Corner> corners = DetectHarrisCorners(fitter.scorer().reference_image(), {}, pool);
  result.corners = static_cast<int64_t>(corners.size());

  constexpr int64_t kGrain = 32;
  struct Piece {
    std::vector<Seed> seeds;
    std::vector<uint32_t> covered;
  };
  std::vector<Piece> pieces((corners.size() + kGrain - 1) / kGrain);
  pool.ParallelFor(result.corners, kGrain, [&](int64_t begin, int64_t end) {
    Piece& piece = pieces[static_cast<size_t>(begin / kGrain)];
    for (int64_t i = begin; i < end; ++i) {
      const uint32_t agreeing = matcher.SeedCorner(corners[static_cast<size_t>(i)], piece.seeds);
      if (agreeing != 0) piece.covered.push_back(agreeing);
    }
  });
  for (const Piece& piece : pieces) {
    result.seeds.insert(result.seeds.end(), piece.seeds.begin(), piece.seeds.end());
    result.covered_corners += static_cast<int64_t>(piece.covered.size());
    for (const uint32_t agreeing : piece.covered) {
      for (size_t t = 0; t < result.covered_matches_per_target.size(); ++t) {
        result.covered_matches_per_target[t] += agreeing >> t & 1U;
      }
    }
  }
  return result;
}

}  // namespace meshwright
