// SPDX-License-Identifier: Apache-2.0
#include <benchmark/benchmark.h>

#include "worker/camera_job/camera_job.h"
#include "worker/seeding/harris.h"
#include "worker/testing/synthetic_views.h"

// The stages of one camera job, each on what the one before it made of a small facade; one thread, so that the figures
// are of the work and not of the machine's cores.
namespace meshwright {
namespace {

constexpr int kStep = 2;  // px

struct Stages {
  testing_world::SyntheticViews views = testing_world::MakeSyntheticViews(kStep);
  ThreadPool pool{1};
  PatchScorer scorer = views.Scorer();
  AcceptedDepth nothing_accepted = AcceptedDepth::Empty(views.reference_camera(), kStep);
  std::vector<Seed> seeds = FindSeeds(scorer, {}, nothing_accepted, views.lattice, {}, pool).seeds;
  PatchStacks stacks = Grow(scorer, seeds, nothing_accepted, {}, pool);
  FilteringResult filtering = FilterPatches(stacks, views.reference_camera(), {}, pool);
};

Stages& SharedStages() {
  static Stages stages;
  return stages;
}

void BM_DetectHarrisCorners(benchmark::State& state) {
  Stages& stages = SharedStages();
  const SamplingImage& image = stages.scorer.reference_image();
  for (auto _ : state) benchmark::DoNotOptimize(DetectHarrisCorners(image, {}, stages.pool));
  state.SetItemsProcessed(int64_t{image.width()} * image.height() * state.iterations());
}
BENCHMARK(BM_DetectHarrisCorners)->Unit(benchmark::kMillisecond);

void BM_FindSeeds(benchmark::State& state) {
  Stages& stages = SharedStages();
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        FindSeeds(stages.scorer, {}, stages.nothing_accepted, stages.views.lattice, {}, stages.pool));
  }
  state.SetItemsProcessed(static_cast<int64_t>(stages.seeds.size()) * state.iterations());
}
BENCHMARK(BM_FindSeeds)->Unit(benchmark::kMillisecond);

void BM_Grow(benchmark::State& state) {
  Stages& stages = SharedStages();
  for (auto _ : state) {
    benchmark::DoNotOptimize(Grow(stages.scorer, stages.seeds, stages.nothing_accepted, {}, stages.pool));
  }
  state.SetItemsProcessed(stages.stacks.tentative_patches_scored * state.iterations());
}
BENCHMARK(BM_Grow)->Unit(benchmark::kMillisecond);

void BM_FilterPatches(benchmark::State& state) {
  Stages& stages = SharedStages();
  for (auto _ : state) {
    benchmark::DoNotOptimize(FilterPatches(stages.stacks, stages.views.reference_camera(), {}, stages.pool));
  }
  state.SetItemsProcessed(stages.views.lattice.nodes() * state.iterations());
}
BENCHMARK(BM_FilterPatches)->Unit(benchmark::kMillisecond);

void BM_RefineSurface(benchmark::State& state) {
  Stages& stages = SharedStages();
  int64_t scored = 0;
  for (auto _ : state) {
    SurfaceEstimate surface = stages.filtering.surface;
    scored += RefineSurface(stages.scorer, {}, surface, stages.pool);
    benchmark::DoNotOptimize(surface);
  }
  state.SetItemsProcessed(scored);
}
BENCHMARK(BM_RefineSurface)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace meshwright
