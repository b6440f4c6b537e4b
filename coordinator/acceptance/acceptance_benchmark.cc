// SPDX-License-Identifier: Apache-2.0
#include <memory>
#include <vector>

#include <benchmark/benchmark.h>

#include "coordinator/acceptance/acceptance.h"

namespace meshwright {
namespace {

// A plane at depth 10 seen by cameras side by side; `offset` moves the supporters' patches out of reach.
PatchLattice Plane(CameraIndex index, double x, double offset) {
  Camera camera{.width = 2048, .height = 2048, .fx = 2000, .fy = 2000, .cx = 1024, .cy = 1024};
  camera.cam_from_world.translation = {-x, 0, 0};
  PatchLattice surface = PatchLattice::Empty(index, camera, 2);
  surface.depth.assign(surface.depth.size(), static_cast<float>(10 + offset));
  return surface;
}

// One million patches against six supporters. Argument 1: all agree and six votes are asked for, 0: none agrees.
void BM_AcceptSurface(benchmark::State& state) {
  const bool agree = state.range(0) == 1;
  ThreadPool pool(static_cast<int>(state.range(1)));
  const PatchLattice filtered = Plane(0, 0, 0);
  std::vector<std::shared_ptr<const SparseSurface>> supporters;
  for (int i = 1; i <= 6; ++i) {
    supporters.push_back(
        std::make_shared<const SparseSurface>(SparseSurface::From(Plane(i, 0.1 * i, agree ? 0.001 : 0.2))));
  }
  for (auto _ : state) {
    auto result = AcceptSurface(
        filtered, 6, [&](int i) { return supporters[static_cast<size_t>(i)]; }, {.k_a = 6}, pool);
    benchmark::DoNotOptimize(result);
  }
}
BENCHMARK(BM_AcceptSurface)->ArgsProduct({{0, 1}, {1, 2}})->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
}  // namespace meshwright
