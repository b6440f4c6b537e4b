// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/surface_overlap.h"

#include <algorithm>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "common/surface/random_surface_testing.h"

namespace meshwright {
namespace {

Camera Turned(const Camera& camera, double angle, const Eigen::Vector3d& shift) {
  Camera turned = camera;
  turned.cam_from_world.rotation =
      Eigen::AngleAxisd(angle, Eigen::Vector3d(1, -1, 0.5).normalized()).toRotationMatrix() *
      camera.cam_from_world.rotation;
  turned.cam_from_world.translation += shift;
  return turned;
}

// One sheet with some noise, so that some patches are covered and others are not.
PatchLattice Sheet(uint32_t seed, const Camera& camera, double density) {
  PatchLattice surface = RandomSurface(seed, camera, 1, density, 1);
  for (size_t node = 0; node < surface.depth.size(); ++node) {
    if (!(surface.depth[node] > 0)) continue;
    surface.depth[node] = 2 + 0.1F * (surface.depth[node] - 1);
    surface.normal_in_world[node] = -camera.viewing_direction_in_world().cast<float>();
  }
  return surface;
}

// Per patch of `surface`.
std::vector<uint8_t> Covered(const PatchLattice& surface, const PatchLattice& cover, ThreadPool& pool) {
  const SparseSurface sparse = SparseSurface::From(surface);
  const SparseSurface sparse_cover = SparseSurface::From(cover);
  std::vector<uint8_t> removed(sparse.patches(), 0);
  MarkCovered(sparse, sparse_cover, CornersOfTriangles(sparse_cover), 3, pool, removed);
  return removed;
}

SurfaceOutline OutlineOf(const PatchLattice& surface) { return SurfaceOutline(SparseSurface::From(surface)); }

TEST(SurfaceOverlapTest, OutlinesMissNoOverlap) {
  ThreadPool pool(1);
  int overlaps = 0;
  int apart = 0;
  for (uint32_t seed = 0; seed < 60; ++seed) {
    const Camera camera = SmallCamera(50, 40);
    const PatchLattice first = Sheet(seed, camera, 0.1 + 0.01 * seed);
    const PatchLattice second =
        Sheet(seed + 100, Turned(camera, 0.03 * (seed % 40), {0.06 * seed, 0, 0.01 * seed}), 0.3);
    const std::vector<uint8_t> removed = Covered(second, first, pool);
    const bool may_overlap = OutlineOf(second).MayOverlap(OutlineOf(first), 3);
    if (std::ranges::count(removed, 1) > 0) {
      EXPECT_TRUE(may_overlap) << seed;
      ++overlaps;
    }
    apart += may_overlap ? 0 : 1;
  }
  EXPECT_GT(overlaps, 10);
  EXPECT_GT(apart, 5);
}

TEST(SurfaceOverlapTest, SurfaceCoversItselfWhereItHasTriangles) {
  ThreadPool pool(2);
  const PatchLattice surface = Sheet(3, SmallCamera(50, 40), 0.7);
  const std::vector<bool> in_triangle = CornersOfTriangles(SparseSurface::From(surface));
  EXPECT_EQ(Covered(surface, surface, pool), std::vector<uint8_t>(in_triangle.begin(), in_triangle.end()));
}

TEST(SurfaceOverlapTest, PatchesTooFarFromThePlaneOrTurnedAwayStay) {
  ThreadPool pool(1);
  const Camera camera = SmallCamera(50, 40);
  const PatchLattice cover = Sheet(1, camera, 1);
  const auto covered = [&](const PatchLattice& surface) {
    return std::ranges::count(Covered(surface, cover, pool), 1);
  };
  PatchLattice surface = cover;
  const int64_t all = covered(surface);
  EXPECT_EQ(all, surface.CountPatches());
  const float step = 2.1F / static_cast<float>(camera.focal());
  for (float& depth : surface.depth) depth += 2.5F * step;
  EXPECT_EQ(covered(surface), all);
  for (float& depth : surface.depth) depth += 1.5F * step;
  EXPECT_EQ(covered(surface), 0);
  surface = cover;
  for (auto& normal : surface.normal_in_world) normal = -normal;
  EXPECT_EQ(covered(surface), 0);
}

}  // namespace
}  // namespace meshwright
