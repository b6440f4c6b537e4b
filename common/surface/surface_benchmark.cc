// SPDX-License-Identifier: Apache-2.0
#include <benchmark/benchmark.h>

#include "common/surface/codec.h"
#include "common/surface/random_surface_testing.h"
#include "common/surface/triangulation_testing.h"

namespace meshwright {
namespace {

PatchLattice BenchmarkSurface() { return RandomSurface(1, SmallCamera(1536, 1024), 1, 0.9, 0.95); }

void BM_EncodeSurface(benchmark::State& state) {
  const PatchLattice surface = BenchmarkSurface();
  int64_t bytes = 0;
  for (auto _ : state) bytes += static_cast<int64_t>(EncodeSurface(surface).size());
  state.SetBytesProcessed(bytes);
}
BENCHMARK(BM_EncodeSurface)->Unit(benchmark::kMillisecond);

void BM_DecodeSurface(benchmark::State& state) {
  const std::string bytes = EncodeSurface(BenchmarkSurface());
  for (auto _ : state) benchmark::DoNotOptimize(DecodeSurface(bytes));
  state.SetBytesProcessed(static_cast<int64_t>(bytes.size()) * state.iterations());
}
BENCHMARK(BM_DecodeSurface)->Unit(benchmark::kMillisecond);

void BM_TriangulateLattice(benchmark::State& state) {
  const PatchLattice surface = BenchmarkSurface();
  for (auto _ : state) benchmark::DoNotOptimize(TriangulateLattice(surface));
  state.SetItemsProcessed(surface.CountPatches() * state.iterations());
}
BENCHMARK(BM_TriangulateLattice)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace meshwright
