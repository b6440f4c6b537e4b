#include "common/mesh/surface_union.h"

#include <filesystem>
#include <set>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "common/base/process_usage.h"
#include "common/mesh/ply.h"
#include "common/surface/random_surface_testing.h"
#include "common/surface/triangulation.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

class SurfaceUnionTest : public testing::Test {
 protected:
  SurfaceUnionTest()
      : folder_(fs::path(testing::TempDir()) / ("meshwright_surface_union_test_" + std::to_string(::getpid()))) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~SurfaceUnionTest() override { fs::remove_all(folder_); }
  std::string Path(const std::string& name) const { return (folder_ / name).string(); }
  fs::path folder_;
};

TEST_F(SurfaceUnionTest, MeshOfASurfaceHasItsTrianglesAndNoLooseVertex) {
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

TEST_F(SurfaceUnionTest, UnionIsThePartsSideBySide) {
  const auto surface_of = [](int64_t i) {
    return RandomSurface(static_cast<uint32_t>(i), SmallCamera(40 + static_cast<int>(i), 25), 1, 0.8, 0.9);
  };
  const auto counts = WriteSurfaceUnion(5, surface_of, Path("union.ply"));
  ASSERT_TRUE(counts.ok()) << counts.status();
  const auto mesh = ReadPly(Path("union.ply"));
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_EQ(counts->vertices, static_cast<int64_t>(mesh->positions.size()));
  EXPECT_EQ(counts->faces, static_cast<int64_t>(mesh->faces.size()));
  size_t vertex = 0;
  size_t face = 0;
  for (int64_t i = 0; i < 5; ++i) {
    ASSERT_TRUE(WriteSurfacePart(surface_of(i), Path("part.ply")).ok());
    const auto part = ReadPly(Path("part.ply"));
    ASSERT_TRUE(part.ok()) << part.status();
    ASSERT_LE(vertex + part->positions.size(), mesh->positions.size());
    for (size_t v = 0; v < part->positions.size(); ++v) {
      EXPECT_EQ(part->positions[v], mesh->positions[vertex + v]);
      EXPECT_EQ(part->normals[v], mesh->normals[vertex + v]);
      EXPECT_EQ(part->colors[v], mesh->colors[vertex + v]);
      EXPECT_EQ(part->quality[v], mesh->quality[vertex + v]);
      EXPECT_EQ(part->cameras[v], mesh->cameras[vertex + v]);
    }
    for (size_t f = 0; f < part->faces.size(); ++f, ++face) {
      for (int k = 0; k < 3; ++k) EXPECT_EQ(part->faces[f][k] + vertex, mesh->faces[face][k]);
    }
    vertex += part->positions.size();
  }
  EXPECT_EQ(vertex, mesh->positions.size());
  EXPECT_EQ(face, mesh->faces.size());
}

TEST_F(SurfaceUnionTest, NothingAcceptedIsAnEmptyMesh) {
  const auto counts = WriteSurfaceUnion(
      0, [](int64_t) { return PatchLattice(); }, Path("empty.ply"));
  ASSERT_TRUE(counts.ok()) << counts.status();
  const auto mesh = ReadPly(Path("empty.ply"));
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_TRUE(mesh->positions.empty());
}

TEST_F(SurfaceUnionTest, SurfaceThatCannotBeLoadedLeavesNoFile) {
  const auto load = [](int64_t i) -> absl::StatusOr<PatchLattice> {
    if (i == 2) return absl::DataLossError("surface 2 is damaged");
    return RandomSurface(1, SmallCamera(30, 30), 1, 1, 1);
  };
  const auto counts = WriteSurfaceUnion(3, load, Path("a.ply"));
  EXPECT_EQ(counts.status(), absl::DataLossError("surface 2 is damaged"));
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(SurfaceUnionTest, MemoryDependsOnTheLargestSurfaceOnly) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers keep memory that the program gave back";
#endif
  const PatchLattice surface = RandomSurface(1, SmallCamera(400, 300), 1, 1, 1);
  const auto load = [&](int64_t) -> absl::StatusOr<PatchLattice> { return surface; };
  ASSERT_TRUE(WriteSurfaceUnion(2, load, Path("a.ply")).ok());
  const int64_t before = MeasureProcessUsage().peak_rss_bytes;
  ASSERT_TRUE(WriteSurfaceUnion(12, load, Path("a.ply")).ok());
  // Ten more surfaces make a mesh that is 70 MB larger in memory.
  EXPECT_LT(MeasureProcessUsage().peak_rss_bytes - before, int64_t{12} << 20);
}

}  // namespace
}  // namespace meshwright
