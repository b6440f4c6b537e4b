// SPDX-License-Identifier: Apache-2.0
#include "common/surface/sparse_surface.h"

#include <tuple>

#include <gtest/gtest.h>

#include "common/surface/random_surface_testing.h"

namespace meshwright {
namespace {

TEST(SparseSurface, LatticeAndBackIsTheSame) {
  for (const double density : {0.0, 0.01, 0.5, 1.0}) {
    for (const auto& [width, height, step] : {std::tuple{1, 1, 1}, {64, 2, 1}, {31, 57, 2}}) {
      const PatchLattice surface = RandomSurface(3, SmallCamera(width, height), step, density, 0.8);
      const SparseSurface sparse = SparseSurface::From(surface);
      EXPECT_EQ(static_cast<int64_t>(sparse.patches()), surface.CountPatches());
      for (size_t patch = 0; patch < sparse.patches(); ++patch) {
        EXPECT_EQ(surface.lattice.Index(sparse.Column(patch), sparse.Row(patch)), sparse.node[patch]);
        EXPECT_EQ(sparse.Point(patch), surface.Point(sparse.Column(patch), sparse.Row(patch)));
      }
      const PatchLattice back = sparse.ToLattice();
      EXPECT_EQ(back.depth, surface.depth);
      EXPECT_EQ(back.normal_in_world, surface.normal_in_world);
      EXPECT_EQ(back.quality, surface.quality);
      EXPECT_EQ(back.rgb, surface.rgb);
      EXPECT_EQ(back.links, surface.links);
    }
  }
}

TEST(SparseSurface, MemoryFollowsThePatchesNotThePhotograph) {
  const SparseSurface few = SparseSurface::From(RandomSurface(1, SmallCamera(1000, 1000), 1, 0.001, 0));
  EXPECT_LT(few.bytes(), 100'000);
  EXPECT_GT(few.bytes(), static_cast<int64_t>(28 * few.patches()));
}

TEST(PatchFinder, FindsWhatASearchFinds) {
  for (const double density : {0.0, 0.02, 0.6, 1.0}) {
    for (const auto& [width, height] : {std::pair{1, 1}, {63, 3}, {64, 2}, {41, 29}}) {
      const SparseSurface surface = SparseSurface::From(RandomSurface(5, SmallCamera(width, height), 1, density, 0));
      const PatchFinder finder(surface);
      int32_t next = 0;
      for (int32_t node = 0; node < surface.lattice.nodes(); ++node) {
        const bool has =
            next < static_cast<int32_t>(surface.patches()) && surface.node[static_cast<size_t>(next)] == node;
        EXPECT_EQ(finder.FirstFrom(node), next);
        EXPECT_EQ(finder.At(node), has ? next : PatchFinder::kNone);
        if (has) ++next;
      }
      EXPECT_EQ(finder.FirstFrom(surface.lattice.nodes()), next);
    }
  }
}

}  // namespace
}  // namespace meshwright
