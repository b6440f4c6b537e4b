// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/surface_mesh.h"

#include <filesystem>
#include <set>
#include <string>

#include <gtest/gtest.h>
#include <unistd.h>

#include "common/mesh/ply.h"
#include "common/surface/random_surface_testing.h"
#include "common/surface/triangulation_testing.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

class SurfaceMeshTest : public testing::Test {
 protected:
  SurfaceMeshTest()
      : folder_(fs::path(testing::TempDir()) / ("meshwright_surface_mesh_test_" + std::to_string(::getpid()))) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~SurfaceMeshTest() override { fs::remove_all(folder_); }
  std::string Path(const std::string& name) const { return (folder_ / name).string(); }
  fs::path folder_;
};

TEST_F(SurfaceMeshTest, MeshOfASurfaceHasItsTrianglesAndNoLooseVertex) {
  for (uint32_t seed = 0; seed < 10; ++seed) {
    const PatchLattice surface = RandomSurface(seed, SmallCamera(31, 22), 1, 0.6, 0.7);
    const auto triangles = TriangulateLattice(surface);
    const TriangleMesh mesh = MeshOfSurface(surface);
    ASSERT_EQ(mesh.faces.size(), triangles.size());
    std::set<uint32_t> used;
    for (size_t f = 0; f < triangles.size(); ++f) {
      for (int k = 0; k < 3; ++k) {
        const auto node = static_cast<size_t>(triangles[f][k]);
        const uint32_t vertex = mesh.faces[f][k];
        used.insert(vertex);
        EXPECT_EQ(mesh.positions[vertex], surface.Point(triangles[f][k] % 31, triangles[f][k] / 31).cast<float>());
        EXPECT_EQ(mesh.normals[vertex], surface.normal_in_world[node]);
        EXPECT_EQ(mesh.colors[vertex], surface.rgb[node]);
        EXPECT_EQ(mesh.quality[vertex], surface.quality[node]);
        EXPECT_EQ(mesh.cameras[vertex], surface.camera_index);
      }
    }
    EXPECT_EQ(used.size(), mesh.positions.size());
    EXPECT_EQ(mesh.normals.size(), mesh.positions.size());
  }
}

TEST_F(SurfaceMeshTest, PartIsWrittenWhole) {
  const PatchLattice surface = RandomSurface(3, SmallCamera(40, 25), 1, 0.8, 0.9);
  ASSERT_TRUE(WriteSurfacePart(surface, Eigen::Vector3d::Zero(), Path("part.ply")).ok());
  const auto part = ReadPly(Path("part.ply"));
  ASSERT_TRUE(part.ok()) << part.status();
  const TriangleMesh mesh = MeshOfSurface(surface);
  EXPECT_EQ(part->positions, mesh.positions);
  EXPECT_EQ(part->normals, mesh.normals);
  EXPECT_EQ(part->colors, mesh.colors);
  EXPECT_EQ(part->quality, mesh.quality);
  EXPECT_EQ(part->cameras, mesh.cameras);
  EXPECT_EQ(part->faces, mesh.faces);
}

}  // namespace
}  // namespace meshwright
