// SPDX-License-Identifier: Apache-2.0
#include "worker/camera_job/camera_job.h"

#include <algorithm>
#include <utility>

#include "common/base/check.h"
#include "common/base/clock.h"
#include "common/base/out_of_range.h"
#include "common/base/status_macros.h"
#include "worker/camera_job/smaller_photographs.h"
#include "worker/completion/completion.h"
#include "worker/filtering/epipolar_offsets.h"

namespace meshwright {
namespace {

constexpr int kWidestLattice = 16;  // px

}  // namespace

std::vector<SparsePointObservation> ObservationsOf(const CameraJobInput& input) {
  std::vector<SparsePointObservation> observations;
  for (size_t i = 0; i < input.sparse_points.size(); ++i) {
    SparsePointObservation observation{input.sparse_points[i], 0};
    for (size_t t = 0; t < input.targets.size(); ++t) {
      const auto& seen_by = input.sparse_points_seen_by[i];
      if (std::find(seen_by.begin(), seen_by.end(), input.targets[t].camera_index) != seen_by.end()) {
        observation.seen_by |= uint32_t{1} << t;
      }
    }
    observations.push_back(observation);
  }
  return observations;
}

absl::Status CameraJobOptions::Validate() const {
  if (lattice_step < 1 || lattice_step > 16) return OutOfRange("lattice_step", lattice_step, "1..16 px");
  MW_RETURN_IF_ERROR(scoring.Validate());
  MW_RETURN_IF_ERROR(seeding.Validate());
  MW_RETURN_IF_ERROR(growing.Validate());
  MW_RETURN_IF_ERROR(filtering.Validate());
  if (halvings < 0 || halvings > 4) return OutOfRange("halvings", halvings, "0..4");
  return completion.Validate();
}

PatchScorer MakeScorer(const CameraJobInput& input, const PatchScorer::Options& options) {
  std::vector<ScoredView> targets;
  for (const JobView& target : input.targets) targets.push_back({target.camera, target.grey});
  return PatchScorer({input.reference.camera, input.reference.grey}, std::move(targets), options, input.region);
}

CameraJobResult RunCameraJob(const CameraJobInput& input, const CameraJobOptions& options, ThreadPool& pool) {
  PatchStacks grown;
  return RunFollowedCameraJob(input, options, grown, pool);
}

CameraJobResult RunFollowedCameraJob(const CameraJobInput& input, const CameraJobOptions& options, PatchStacks& grown,
                                     ThreadPool& pool) {
  MW_CHECK(input.targets.size() <= kMaxTargets);
  CameraJobResult result;
  CameraJobReport& report = result.report;
  Stopwatch timer;
  const Camera& reference = input.reference.camera;
  const PatchScorer scorer = MakeScorer(input, options.scoring);
  report.rays = input.accepted.lattice.nodes();
  report.rays_covered_before =
      std::count_if(input.accepted.depth.begin(), input.accepted.depth.end(), [](float z) { return z > 0; });

  // Section 3.5: seeds.
  const SeedingResult seeding =
      FindSeeds(scorer, ObservationsOf(input), input.accepted, input.accepted.lattice, options.seeding, pool);
  for (size_t t = 0; t < input.targets.size(); ++t) {
    // A region has few seeds however good a pair is.
    const bool is_weak = seeding.matches_per_target[t] < options.seeding.min_seeds_per_pair;
    if (is_weak && !input.region.has_value()) {
      result.weak_targets.push_back(input.targets[t].camera_index);
    }
  }
  std::sort(result.weak_targets.begin(), result.weak_targets.end());
  report.seeds = static_cast<int64_t>(seeding.seeds.size());
  report.seeds_from_points = seeding.seeds_from_points;
  report.seconds_seeding = timer.Lap();

  // Section 3.6: growing.
  grown = Grow(scorer, seeding.seeds, input.accepted, options.growing, pool);
  report.patches_grown = static_cast<int64_t>(grown.patches.size());
  report.rays_grown = grown.CountRays();
  report.tentative_patches_scored = grown.tentative_patches_scored;
  report.seconds_growing = timer.Lap();

  // Section 3.7: MRF filtering, then depth and normals beyond the step d_r.
  FilteringResult filtering = FilterPatches(grown, reference, options.filtering, pool);
  report.mrf_energy = filtering.energy;
  report.mrf_lower_bound = filtering.lower_bound;
  report.seconds_filtering = timer.Lap();
  PatchScorer::Options fine_scoring = options.scoring;
  fine_scoring.window_radius = options.filtering.refinement.window_radius;
  const PatchScorer fine_scorer = MakeScorer(input, fine_scoring);
  report.tentative_patches_scored += RefineSurface(fine_scorer, options.filtering.refinement, filtering.surface, pool);
  const EpipolarOffsets offsets = MeasureEpipolarOffsets(scorer, filtering.surface, pool);
  report.epipolar_squares = offsets.sum_of_squares;
  report.epipolar_measurements = offsets.measurements;

  // Ours: smaller photographs, then planes, close what photographs are blind for.
  const std::vector<PatchPlane> on_smaller =
      GrowOnSmallerPhotographs(input, scorer, options, filtering.surface, report.tentative_patches_scored, pool);
  report.rays_inferred =
      CompleteSurface(scorer, input.accepted, on_smaller, options.completion, filtering.surface, pool);
  result.filtered =
      MakeFilteredSurface(filtering.surface, input.reference.camera_index, reference, *input.reference_color);
  report.rays_filtered = result.filtered.CountPatches() - report.rays_inferred;
  report.seconds_refinement = timer.Lap();
  return result;
}

int64_t EstimateCameraJobBytes(const Camera& reference, const CameraJobOptions& options) {
  const int64_t nodes = Lattice::For(reference, options.lattice_step).nodes();
  // Two grown patches a ray is typical at full coverage; vectors double when they grow.
  constexpr int64_t kPatchesPerRay = 2;
  constexpr int64_t kBytesPerPatch = 2 * sizeof(GrownPatch) + 64;
  constexpr int64_t kBytesPerNode = 64;
  // All views once more at half the size, with the sizes below: 4 bytes for each of a third of their pixels and ninth.
  constexpr int64_t kBytesPerPixelOfSmaller = 4 * (kMaxTargets + 1) * 4 / 9;
  // What has grown at full size is there while on smaller photographs a third of it grows.
  const int64_t at_full_size = nodes * (kPatchesPerRay * kBytesPerPatch + kBytesPerNode);
  if (options.halvings == 0) return at_full_size;
  return at_full_size * 4 / 3 + kBytesPerPixelOfSmaller * reference.width * reference.height;
}

CameraJobOptions Reduced(CameraJobOptions options, int reduction) {
  for (; reduction > 0 && options.lattice_step < kWidestLattice; --reduction) {
    options.lattice_step = std::min(2 * options.lattice_step, kWidestLattice);
  }
  return options;
}

}  // namespace meshwright
