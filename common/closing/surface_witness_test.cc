// SPDX-License-Identifier: Apache-2.0
#include "common/closing/surface_witness.h"

#include <functional>

#include <gtest/gtest.h>

namespace meshwright {
namespace {

// Looks along z from the origin, 160 x 120 px, two px a step; a step at depth 1 is 1/50.
Camera Viewer() { return {160, 120, 100, 100, 80, 60, {}}; }

// Depth by lattice node; 0: nothing.
SparseSurface SurfaceOf(const std::function<double(int column, int row)>& depth) {
  PatchLattice surface = PatchLattice::Empty(0, Viewer(), 2);
  for (int row = 0; row < surface.lattice.rows; ++row) {
    for (int column = 0; column < surface.lattice.columns; ++column) {
      const auto node = static_cast<size_t>(surface.lattice.Index(column, row));
      surface.depth[node] = static_cast<float>(depth(column, row));
      if (!(surface.depth[node] > 0)) continue;
      surface.normal_in_world[node] = {0, 0, -1};
      surface.quality[node] = 0.9F;
    }
  }
  return SparseSurface::From(surface);
}

bool InHole(int column, int row) { return column > 30 && column < 50 && row > 20 && row < 40; }

// In the middle of the picture, `size` across, at depth z, its front towards the camera.
std::array<Eigen::Vector3d, 3> Triangle(double z, double size) {
  return {{{-0.5 * size, -0.3 * size, z}, {0, 0.6 * size, z}, {0.5 * size, -0.3 * size, z}}};
}

TEST(SurfaceWitness, HasMeasuredWhatItsSurfacePasses) {
  const SparseSurface surface = SurfaceOf([](int column, int row) { return InHole(column, row) ? 0.0 : 2.0; });
  const SurfaceWitness witness(surface);
  const Eigen::Vector3d beside = Viewer().BackProject(40, 30, 2);
  EXPECT_TRUE(witness.Measured(beside, 0.1));
  EXPECT_TRUE(witness.Measured(beside * (2.05 / 2), 0.1));
  EXPECT_FALSE(witness.Measured(beside * (2.2 / 2), 0.1));
  EXPECT_FALSE(witness.Measured({0, 0, 2}, 0.1)) << "in the hole";
  EXPECT_FALSE(witness.Measured({0, 0, -2}, 0.1)) << "behind the camera";
  EXPECT_FALSE(witness.Measured({9, 0, 2}, 0.1)) << "outside of the picture";
}

TEST(GapWitness, VouchesForWhatClosesAGapInItsSurface) {
  const SparseSurface surface = SurfaceOf([](int column, int row) { return InHole(column, row) ? 0.0 : 2.0; });
  const SurfaceWitness witness(surface);
  const GapWitness gap(witness, 0.33);
  EXPECT_TRUE(gap.Vouches(Triangle(2, 0.3)));
  EXPECT_EQ(witness.CountLooksThrough(Triangle(2, 0.3)), 0);
  const auto [a, b, c] = Triangle(2, 0.3);
  EXPECT_FALSE(gap.Vouches({a, c, b})) << "its back";
  EXPECT_FALSE(GapWitness(witness, 0.05).Vouches(Triangle(2, 0.3))) << "too large";
  const Eigen::Vector3d far_back = b + Eigen::Vector3d(0, 0, 3);
  EXPECT_FALSE(gap.Vouches({a, far_back, c})) << "too flat to show anything";
}

TEST(GapWitness, DoesNotVouchBeyondARim) {
  // Surface in the lower half alone.
  const SparseSurface surface = SurfaceOf([](int, int row) { return row > 32 ? 2.0 : 0.0; });
  const SurfaceWitness witness(surface);
  EXPECT_FALSE(GapWitness(witness, 1).Vouches(Triangle(2, 0.3)));
}

TEST(GapWitness, DoesNotVouchForWhatIsHidden) {
  const SparseSurface surface = SurfaceOf([](int, int) { return 2.0; });
  const SurfaceWitness witness(surface);
  const GapWitness gap(witness, 0.33);
  EXPECT_TRUE(gap.Vouches(Triangle(2.1, 0.3))) << "on the surface, within three steps";
  EXPECT_FALSE(gap.Vouches(Triangle(3, 0.3)));
  EXPECT_EQ(witness.CountLooksThrough(Triangle(3, 0.3)), 0);
}

TEST(SurfaceWitness, CountsTheRaysThatPassThrough) {
  const SparseSurface surface = SurfaceOf([](int, int) { return 4.0; });
  const SurfaceWitness witness(surface);
  // At depth 2 a step is 1/25: a triangle of 0.5 * 0.4 * 0.36 is crossed by some 45 rays.
  EXPECT_NEAR(static_cast<double>(witness.CountLooksThrough(Triangle(2, 0.4))), 0.072 * 625, 8);
  EXPECT_EQ(witness.CountLooksThrough(Triangle(3.9, 0.4)), 0) << "its own surface";
  EXPECT_EQ(witness.CountLooksThrough(Triangle(-2, 0.4)), 0) << "behind the camera";
}

TEST(SurfaceWitness, HasNotMeasuredWhatItInferred) {
  PatchLattice lattice = SurfaceOf([](int, int) { return 4.0; }).ToLattice();
  for (float& quality : lattice.quality) quality = PatchLattice::kInferredQuality;
  const SparseSurface surface = SparseSurface::From(lattice);
  const SurfaceWitness witness(surface);
  EXPECT_FALSE(witness.Measured({0, 0, 4}, 0.1));
  EXPECT_GT(witness.CountLooksThrough(Triangle(2, 0.4)), 20) << "but it is not to be hidden";
}

}  // namespace
}  // namespace meshwright
