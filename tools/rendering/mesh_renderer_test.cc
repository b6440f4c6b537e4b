// SPDX-License-Identifier: Apache-2.0
#include "tools/rendering/mesh_renderer.h"

#include <cmath>
#include <numbers>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace meshwright {
namespace {

using Rgb = std::array<uint8_t, 3>;

// A square across the optical axis at z = 5, seen by the camera at the origin as the middle 20 x 20 pixels.
TriangleMesh Square() {
  TriangleMesh mesh;
  mesh.positions = {{-1, -1, 5}, {-1, 1, 5}, {1, 1, 5}, {1, -1, 5}};
  mesh.colors.assign(4, {10, 200, 30});
  mesh.faces = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

const Camera kCamera{.width = 40, .height = 40, .fx = 50, .fy = 50, .cx = 20, .cy = 20};

TEST(MeshRendererTest, ShowsColoursWhereTheMeshIsAndBackgroundElsewhere) {
  const TriangleMesh mesh = Square();
  ThreadPool pool(2);
  const ColorImage image = MeshRenderer(mesh).Render(kCamera, {.shading = Shading::kColors}, pool);
  for (int row = 0; row < 40; ++row) {
    for (int column = 0; column < 40; ++column) {
      const bool on_square = row >= 10 && row < 30 && column >= 10 && column < 30;
      EXPECT_EQ(image.At(column, row), on_square ? (Rgb{10, 200, 30}) : (Rgb{255, 255, 255}));
    }
  }
}

TEST(MeshRendererTest, TheBackOfASurfaceIsRed) {
  const TriangleMesh mesh = Square();
  ThreadPool pool(1);
  const MeshRenderer renderer(mesh);
  const Rgb front = renderer.Render(kCamera, {}, pool).At(20, 20);
  const Camera behind = OrbitCamera(kCamera, {0, 0, 5}, std::numbers::pi, 0);
  const Rgb back = renderer.Render(behind, {}, pool).At(20, 20);
  EXPECT_EQ(front[0], front[1]);
  EXPECT_GT(back[0], 2 * back[1]);
}

TEST(MeshRendererTest, PointsHideWhatIsBehindThem) {
  TriangleMesh cloud;
  cloud.positions = {{0.01F, 0.01F, 4}, {0.02F, 0.02F, 8}};
  cloud.colors = {{1, 2, 3}, {100, 100, 100}};
  ThreadPool pool(1);
  const ColorImage image = MeshRenderer(cloud).Render(kCamera, {.shading = Shading::kColors, .point_radius = 1}, pool);
  EXPECT_EQ(image.At(20, 20), (Rgb{1, 2, 3}));
  EXPECT_EQ(image.At(21, 19), (Rgb{1, 2, 3}));
  EXPECT_EQ(image.At(23, 20), (Rgb{255, 255, 255}));
}

TEST(OrbitCameraTest, KeepsThePivotInItsPlaceAndMovesRightAndUp) {
  const TriangleMesh mesh = Square();
  ThreadPool pool(1);
  const Eigen::Vector3d pivot = MeshRenderer(mesh).Pivot(kCamera, pool);
  EXPECT_TRUE(pivot.isApprox(Eigen::Vector3d(0, 0, 5), 1e-6));
  const Camera right = OrbitCamera(kCamera, pivot, 0.3, 0);
  EXPECT_TRUE(right.center_in_world().isApprox(Eigen::Vector3d(5 * std::sin(0.3), 0, 5 - 5 * std::cos(0.3)), 1e-9));
  EXPECT_TRUE(right.CamFromWorld(pivot).isApprox(Eigen::Vector3d(0, 0, 5), 1e-9));
  const Camera above = OrbitCamera(kCamera, pivot, 0, 0.3);
  EXPECT_TRUE(above.center_in_world().isApprox(Eigen::Vector3d(0, -5 * std::sin(0.3), 5 - 5 * std::cos(0.3)), 1e-9));
}

}  // namespace
}  // namespace meshwright
