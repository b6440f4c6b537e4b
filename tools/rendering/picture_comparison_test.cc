// SPDX-License-Identifier: Apache-2.0
#include "tools/rendering/picture_comparison.h"

#include <gtest/gtest.h>

namespace meshwright {
namespace {

const Camera kCamera{.width = 40, .height = 40, .fx = 50, .fy = 50, .cx = 20, .cy = 20};

// A square across the optical axis, `half` pixels to each side of the middle.
TriangleMesh Square(float z, float half) {
  const float r = half / 50 * z;
  TriangleMesh mesh;
  mesh.positions = {{-r, -r, z}, {-r, r, z}, {r, r, z}, {r, -r, z}};
  mesh.faces = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

ColorImage Grey(uint8_t value) { return {40, 40, std::vector<uint8_t>(size_t{3} * 40 * 40, value)}; }

TEST(PictureComparison, OnlyWhatTheSurfaceCoversCounts) {
  ThreadPool pool(2);
  ColorImage picture = Grey(100);
  picture.rgb[0] = 0;  // in the corner, where nothing is
  const PictureComparison compared =
      CompareWhereCovered(picture, Grey(110), MeshRayCaster(Square(5, 10)), kCamera, pool);
  EXPECT_EQ(compared.pixels, 400);
  EXPECT_NEAR(compared.psnr_db, 28.13, 0.01);  // 20 log10(255 / 10)
}

TEST(PictureComparison, WithTheTruthOnlyWhereTheSurfaceIsRight) {
  ThreadPool pool(1);
  const MeshRayCaster truth(Square(5, 4));
  const double footprint = 5.0 / 50;
  const auto pixels = [&](double z) {
    const MeshRayCaster surface(Square(static_cast<float>(z), 10));
    return CompareWhereCovered(Grey(1), Grey(2), surface, kCamera, pool, &truth).pixels;
  };
  EXPECT_EQ(pixels(5), 64);
  EXPECT_EQ(pixels(5 + 3.9 * footprint), 64);
  EXPECT_EQ(pixels(5 + 4.1 * footprint), 0);
  EXPECT_EQ(pixels(5 - 4.1 * footprint), 0);
}

}  // namespace
}  // namespace meshwright
