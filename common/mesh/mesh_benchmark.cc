#include <filesystem>
#include <string>

#include <benchmark/benchmark.h>

#include "common/base/check.h"
#include "common/mesh/ply.h"
#include "common/mesh/surface_union.h"
#include "common/surface/random_surface_testing.h"

namespace meshwright {
namespace {

std::string BenchmarkPath() {
  return (std::filesystem::temp_directory_path() / "meshwright_mesh_benchmark.ply").string();
}

// Four surfaces of 1.5 M patches each.
void BM_WriteSurfaceUnion(benchmark::State& state) {
  const PatchLattice surface = RandomSurface(1, SmallCamera(1536, 1024), 1, 0.97, 0.98);
  int64_t bytes = 0;
  for (auto _ : state) {
    MW_CHECK(WriteSurfaceUnion(
                 4, [&](int64_t) { return surface; }, BenchmarkPath())
                 .ok());
    bytes += static_cast<int64_t>(std::filesystem::file_size(BenchmarkPath()));
  }
  state.SetBytesProcessed(bytes);
  state.SetItemsProcessed(4 * surface.CountPatches() * state.iterations());
  std::filesystem::remove(BenchmarkPath());
}
BENCHMARK(BM_WriteSurfaceUnion)->Unit(benchmark::kMillisecond);

void BM_ReadPly(benchmark::State& state) {
  MW_CHECK(WriteSurfacePart(RandomSurface(1, SmallCamera(1536, 1024), 1, 0.97, 0.98), BenchmarkPath()).ok());
  const auto bytes = static_cast<int64_t>(std::filesystem::file_size(BenchmarkPath()));
  for (auto _ : state) benchmark::DoNotOptimize(ReadPly(BenchmarkPath()));
  state.SetBytesProcessed(bytes * state.iterations());
  std::filesystem::remove(BenchmarkPath());
}
BENCHMARK(BM_ReadPly)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace meshwright
