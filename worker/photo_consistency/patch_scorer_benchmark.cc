// SPDX-License-Identifier: Apache-2.0
#include <benchmark/benchmark.h>

#include "worker/photo_consistency/patch_scorer.h"

namespace meshwright {
namespace {

GreyImage Pattern(int width, int height) {
  GreyImage image{width, height, {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) image.grey.push_back(static_cast<uint8_t>((x * 37 + y * 91 + x * y) & 0xFF));
  }
  return image;
}

PatchScorer Scorer(int radius) {
  Camera camera{.width = 1536, .height = 1024, .fx = 1400, .fy = 1400, .cx = 768, .cy = 512};
  Camera target = camera;
  target.cam_from_world.translation = {-0.2, 0, 0};
  const auto image = std::make_shared<SamplingImage>(Pattern(1536, 1024), 3);
  return PatchScorer({camera, image}, {{target, image}}, {.window_radius = radius});
}

void BM_Score(benchmark::State& state) {
  const PatchScorer scorer = Scorer(static_cast<int>(state.range(0)));
  PatchScorer::Window window;
  scorer.MakeWindow(700, 500, window);
  int i = 0;
  for (auto _ : state) {
    const float w = 0.3F + 0.0001F * static_cast<float>(i++ & 63);
    benchmark::DoNotOptimize(scorer.Score(window, 700, 500, {w, 1e-5F, 1e-5F}, 0));
  }
  const int64_t side = 2 * state.range(0) + 1;
  state.counters["samples"] =
      benchmark::Counter(static_cast<double>(side * side * state.iterations()), benchmark::Counter::kIsRate);
}
BENCHMARK(BM_Score)->DenseRange(2, 5);

void BM_MakeWindow(benchmark::State& state) {
  const PatchScorer scorer = Scorer(static_cast<int>(state.range(0)));
  PatchScorer::Window window;
  int x = 20;
  for (auto _ : state) {
    x = x < 1500 ? x + 1 : 20;
    scorer.MakeWindow(x, 500, window);
    benchmark::DoNotOptimize(window);
  }
}
BENCHMARK(BM_MakeWindow)->DenseRange(2, 5);

}  // namespace
}  // namespace meshwright
