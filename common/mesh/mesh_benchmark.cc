// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include "common/base/check.h"
#include "common/mesh/joined_mesh.h"
#include "common/mesh/ply.h"
#include "common/mesh/surface_mesh.h"
#include "common/surface/random_surface_testing.h"

namespace meshwright {
namespace {

std::string BenchmarkPath() {
  return (std::filesystem::temp_directory_path() / "meshwright_mesh_benchmark.ply").string();
}

// Four surfaces of 0.4 M patches each, of the same plane seen from places apart. The argument: simplified to so many
// pixel footprints.
void BM_WriteJoinedMesh(benchmark::State& state) {
  std::vector<std::shared_ptr<const SparseSurface>> surfaces;
  for (int i = 0; i < 4; ++i) {
    Camera camera = SmallCamera(768, 512);
    camera.cam_from_world.translation.x() += 0.7 * i;
    PatchLattice surface = RandomSurface(static_cast<uint32_t>(i), camera, 1, 0.99, 0.99);
    for (float& depth : surface.depth) depth = depth > 0 ? 2 + 0.001F * depth : 0;
    for (auto& normal : surface.normal_in_world) normal = -camera.viewing_direction_in_world().cast<float>();
    surfaces.push_back(std::make_shared<const SparseSurface>(SparseSurface::From(surface)));
  }
  const JoinOptions options = {.simplify_footprints = static_cast<double>(state.range(0))};
  ThreadPool pool(1);
  int64_t faces = 0;
  for (auto _ : state) {
    const auto counts = WriteJoinedMesh(
        4, [&](int64_t i) { return surfaces[static_cast<size_t>(i)]; }, options, Eigen::Vector3d::Zero(),
        BenchmarkPath(), pool);
    MW_CHECK(counts.ok());
    faces += counts->faces + counts->faces_simplified;
  }
  state.SetItemsProcessed(faces);
  std::filesystem::remove(BenchmarkPath());
}
BENCHMARK(BM_WriteJoinedMesh)->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);

void BM_ReadPly(benchmark::State& state) {
  MW_CHECK(WriteSurfacePart(RandomSurface(1, SmallCamera(1536, 1024), 1, 0.97, 0.98), Eigen::Vector3d::Zero(),
                            BenchmarkPath())
               .ok());
  const auto bytes = static_cast<int64_t>(std::filesystem::file_size(BenchmarkPath()));
  for (auto _ : state) benchmark::DoNotOptimize(ReadPly(BenchmarkPath()));
  state.SetBytesProcessed(bytes * state.iterations());
  std::filesystem::remove(BenchmarkPath());
}
BENCHMARK(BM_ReadPly)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace meshwright
