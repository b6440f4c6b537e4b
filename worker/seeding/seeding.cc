// SPDX-License-Identifier: Apache-2.0
#include "worker/seeding/seeding.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include "common/base/check.h"
#include "common/base/out_of_range.h"
#include "common/geometry/level_of_detail.h"
#include "worker/seeding/corner_seeds.h"
#include "worker/seeding/point_seeds.h"
#include "worker/seeding/seed_fitter.h"

namespace meshwright {
namespace {

constexpr size_t kMaxSeedsPerNode = 3;

// Sparse points bound the depth that corners may have when there are so many ...
constexpr size_t kMinPointsForRange = 20;
// ... leaving out this share on either side, and widened by this factor both ways.
constexpr double kOutlierShare = 0.01;
constexpr double kWidening = 2;

struct InverseDepthRange {
  double min_w = std::numeric_limits<double>::min();
  double max_w = std::numeric_limits<double>::max();
};

InverseDepthRange RangeOf(const Camera& reference, const std::vector<SparsePointObservation>& points) {
  std::vector<double> w;
  for (const SparsePointObservation& point : points) {
    const double z = reference.CamFromWorld(point.x_in_world).z();
    if (z > 0 && std::isfinite(1 / z)) w.push_back(1 / z);
  }
  if (w.size() < kMinPointsForRange) return {};
  std::sort(w.begin(), w.end());
  const auto outliers = static_cast<size_t>(kOutlierShare * static_cast<double>(w.size()));
  return {w[outliers] / kWidening, w[w.size() - 1 - outliers] * kWidening};
}

struct TaggedSeed {
  Seed seed;
  bool from_point = false;
};

// Better seeds first within a node; a total order over all that matters.
bool BetterInNode(const TaggedSeed& a, const TaggedSeed& b) {
  const auto key = [](const TaggedSeed& s) {
    return std::make_tuple(s.seed.node, -s.seed.quality, s.seed.plane.w, s.seed.sigma, s.seed.plane.gx, s.seed.plane.gy,
                           !s.from_point);
  };
  return key(a) < key(b);
}

// The best few seeds of every node, none within d_r of another.
std::vector<TaggedSeed> KeepBestPerNode(std::vector<TaggedSeed> seeds, const Camera& reference, int lattice_step) {
  std::sort(seeds.begin(), seeds.end(), BetterInNode);
  std::vector<TaggedSeed> kept;
  size_t first_of_node = 0;
  for (const TaggedSeed& candidate : seeds) {
    if (kept.empty() || kept[first_of_node].seed.node != candidate.seed.node) first_of_node = kept.size();
    if (kept.size() - first_of_node >= kMaxSeedsPerNode) continue;
    const double depth = 1.0 / candidate.seed.plane.w;
    const double same = LevelOfDetail(reference, depth, lattice_step);
    const bool known =
        std::any_of(kept.begin() + static_cast<std::ptrdiff_t>(first_of_node), kept.end(),
                    [&](const TaggedSeed& other) { return std::abs(1.0 / other.seed.plane.w - depth) < same; });
    if (!known) kept.push_back(candidate);
  }
  std::sort(kept.begin(), kept.end(), [](const TaggedSeed& a, const TaggedSeed& b) {
    return std::tie(a.seed.node, a.seed.plane.w) < std::tie(b.seed.node, b.seed.plane.w);
  });
  return kept;
}

}  // namespace

absl::Status SeedingOptions::Validate() const {
  if (!(min_apical_angle_deg >= 0 && min_apical_angle_deg <= 60)) {
    return OutOfRange("seeding.min_apical_angle_deg", min_apical_angle_deg, "0..60");
  }
  if (min_seeds_per_pair < 0) return OutOfRange("seeding.min_seeds_per_pair", min_seeds_per_pair, ">= 0");
  if (!(min_quality >= -1 && min_quality <= 1)) return OutOfRange("seeding.min_quality", min_quality, "-1..1");
  return absl::OkStatus();
}

SeedingResult FindSeeds(const PatchScorer& scorer, const std::vector<SparsePointObservation>& points,
                        const AcceptedDepth& accepted, const Lattice& lattice, const SeedingOptions& options,
                        ThreadPool& pool) {
  MW_CHECK(scorer.targets() <= 32);
  MW_CHECK(accepted.depth.size() == static_cast<size_t>(lattice.nodes()));
  SeedingResult result;
  result.seeds_per_target.assign(static_cast<size_t>(scorer.targets()), 0);
  result.matches_per_target = result.seeds_per_target;
  if (lattice.nodes() == 0 || scorer.targets() == 0) return result;

  const SeedFitter fitter(scorer, accepted, lattice, options);
  const PointSeeds of_points = SeedPoints(fitter, points, pool);
  const InverseDepthRange range = RangeOf(scorer.reference(), points);
  const CornerSeeds of_corners = SeedCorners(fitter, of_points.seeds, range.min_w, range.max_w, lattice, pool);
  result.corners = of_corners.corners;
  result.corners_covered = of_corners.covered_corners;
  result.points_covered = of_points.hidden;
  result.points_inconsistent = of_points.inconsistent;
  result.matches_per_target = of_corners.covered_matches_per_target;

  std::vector<TaggedSeed> all;
  for (const Seed& seed : of_points.seeds) all.push_back({seed, true});
  for (const Seed& seed : of_corners.seeds) all.push_back({seed, false});
  for (const TaggedSeed& kept : KeepBestPerNode(std::move(all), scorer.reference(), lattice.step)) {
    result.seeds.push_back(kept.seed);
    result.seeds_from_points += kept.from_point ? 1 : 0;
    for (size_t t = 0; t < result.seeds_per_target.size(); ++t) {
      const int64_t sees = kept.seed.sigma >> t & 1U;
      result.seeds_per_target[t] += sees;
      result.matches_per_target[t] += sees;
    }
  }
  return result;
}

}  // namespace meshwright
