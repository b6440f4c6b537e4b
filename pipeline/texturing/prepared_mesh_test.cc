// SPDX-License-Identifier: Apache-2.0
#include "pipeline/texturing/prepared_mesh.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "pipeline/texturing/face_graph.h"

namespace meshwright {
namespace {

TriangleMesh Square(float side) {
  TriangleMesh mesh;
  mesh.positions = {{0, 0, 0}, {side, 0, 0}, {side, side, 0}, {0, side, 0}, {9, 9, 9}};
  mesh.colors = {{0, 0, 0}, {100, 0, 0}, {100, 100, 0}, {0, 100, 0}, {1, 2, 3}};
  mesh.faces = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

double Area(const TriangleMesh& mesh) {
  double area = 0;
  for (const auto& [a, b, c] : mesh.faces) {
    const Eigen::Vector3f normal = (mesh.positions[b] - mesh.positions[a]).cross(mesh.positions[c] - mesh.positions[a]);
    EXPECT_GT(normal.z(), 0);  // sides are kept
    area += 0.5 * normal.norm();
  }
  return area;
}

TEST(PreparedMeshTest, LongEdgesAreSplitOnBothSidesAlike) {
  const TriangleMesh mesh = PrepareMesh(Square(7), 0, 0.9);
  EXPECT_NEAR(Area(mesh), 49, 1e-3);
  size_t longest_border = 0;
  for (const auto& face : mesh.faces) {
    for (size_t k = 0; k < 3; ++k) {
      const Eigen::Vector3f& a = mesh.positions[face[k]];
      const Eigen::Vector3f& b = mesh.positions[face[(k + 1) % 3]];
      EXPECT_LE((a - b).norm(), 0.9F);
      const bool is_border =
          (a.x() == b.x() && (a.x() == 0 || a.x() == 7)) || (a.y() == b.y() && (a.y() == 0 || a.y() == 7));
      longest_border += is_border ? 1 : 0;
    }
  }
  // Every edge that is not on the square's border has two faces: no cracks.
  EXPECT_EQ(2 * FindInnerEdges(mesh).size() + longest_border, 3 * mesh.faces.size());
}

TEST(PreparedMeshTest, VerticesWithoutFacesGo) {
  const TriangleMesh mesh = PrepareMesh(Square(1), 0, 10);
  ASSERT_EQ(mesh.positions.size(), 4U);
  EXPECT_EQ(mesh.colors[2], (std::array<uint8_t, 3>{100, 100, 0}));
}

TEST(PreparedMeshTest, FootprintIsDepthByFocalLengthOfTheNearestCamera) {
  Camera camera = {.width = 100, .height = 100, .fx = 50, .fy = 50, .cx = 50, .cy = 50};
  camera.cam_from_world.translation = {0, 0, 10};
  Camera nearer = camera;
  nearer.cam_from_world.translation = {0, 0, 5};
  Camera behind = camera;
  behind.cam_from_world.translation = {0, 0, -1};
  TriangleMesh mesh = Square(1);
  mesh.positions.resize(4);
  EXPECT_NEAR(MedianFootprint(mesh, {camera, nearer, behind}), 0.1, 1e-6);
  EXPECT_EQ(MedianFootprint(mesh, {behind}), 0);
}

}  // namespace
}  // namespace meshwright
