// SPDX-License-Identifier: Apache-2.0
#include <benchmark/benchmark.h>

#include "common/base/thread_pool.h"
#include "worker/mrf/solve.h"
#include "worker/mrf/synthetic_mrf_testing.h"

namespace meshwright {
namespace {

void Report(benchmark::State& state, const GridMrf& mrf, const MrfSolution& solution) {
  state.counters["energy"] = solution.energy;
  state.counters["lower_bound"] = solution.lower_bound;
  state.counters["iterations"] = solution.iterations;
  state.counters["windows"] = solution.windows;
  state.counters["patches"] = static_cast<double>(mrf.patch_cost.size());
  state.counters["per_400k_nodes"] =
      benchmark::Counter(static_cast<double>(state.iterations()) * mrf.NodeCount() / 400e3,
                         benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}

void BM_SolveGlobal(benchmark::State& state) {
  const GridMrf mrf = MakeSurfaceMrf(static_cast<int>(state.range(0)), static_cast<int>(state.range(1)), 1);
  MrfSolution solution;
  while (state.KeepRunning()) solution = SolveGlobal(mrf, TrwsOptions{});
  Report(state, mrf, solution);
}
BENCHMARK(BM_SolveGlobal)->Args({640, 480})->Args({1536, 1024})->Unit(benchmark::kMillisecond);

void BM_SolveInWindows(benchmark::State& state) {
  const GridMrf mrf = MakeSurfaceMrf(static_cast<int>(state.range(0)), static_cast<int>(state.range(1)), 1);
  ThreadPool pool(static_cast<int>(state.range(2)));
  TrwsOptions options;
  options.window_nodes = static_cast<int>(state.range(3));
  MrfSolution solution;
  while (state.KeepRunning()) solution = SolveInWindows(mrf, options, pool);
  Report(state, mrf, solution);
}
BENCHMARK(BM_SolveInWindows)
    ->ArgNames({"columns", "rows", "threads", "window"})
    ->Args({640, 480, 1, 256})
    ->Args({640, 480, 2, 256})
    ->Args({640, 480, 1, 512})
    ->Args({1536, 1024, 1, 256})
    ->Args({1536, 1024, 2, 256})
    ->Args({1536, 1024, 1, 512})
    ->Args({1536, 1024, 2, 512})
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace meshwright
