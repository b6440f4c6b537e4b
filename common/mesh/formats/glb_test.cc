// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/formats/glb.h"

#include <filesystem>
#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include "common/base/files.h"
#include "common/base/little_endian.h"
#include "common/mesh/formats/glb_testing.h"
#include "common/mesh/surface_mesh.h"
#include "common/surface/random_surface_testing.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

class GlbTest : public testing::Test {
 protected:
  GlbTest() : path_(fs::path(testing::TempDir()) / ("meshwright_glb_test_" + std::to_string(::getpid()) + ".glb")) {}
  ~GlbTest() override { fs::remove(path_); }
  Glb Write(const TriangleMesh& mesh) {
    const absl::Status status = WriteGlb(mesh, path_);
    EXPECT_TRUE(status.ok()) << status;
    return SplitGlb(*ReadFile(path_));
  }
  std::string path_;
};

TEST_F(GlbTest, HoldsTheMesh) {
  const TriangleMesh mesh = MeshOfSurface(RandomSurface(1, SmallCamera(200, 150), 1, 0.8, 0.8));
  const Glb glb = Write(mesh);
  const json& primitive = glb.description["meshes"][0]["primitives"][0];
  const auto accessor = [&](const json& number) { return glb.description["accessors"][number.get<size_t>()]; };
  const json positions = accessor(primitive["attributes"]["POSITION"]);
  const json normals = accessor(primitive["attributes"]["NORMAL"]);
  const json colors = accessor(primitive["attributes"]["COLOR_0"]);
  const json indices = accessor(primitive["indices"]);
  EXPECT_EQ(primitive["mode"], 4);
  ASSERT_EQ(positions["count"], mesh.positions.size());
  ASSERT_EQ(indices["count"], 3 * mesh.faces.size());
  Eigen::Vector3f low = mesh.positions[0];
  Eigen::Vector3f high = mesh.positions[0];
  for (size_t i = 0; i < mesh.positions.size(); ++i) {
    ASSERT_EQ(VectorAt(Row(glb, positions, i, 12)), mesh.positions[i]);
    ASSERT_TRUE(VectorAt(Row(glb, normals, i, 12)).isApprox(mesh.normals[i], 1e-5F));
    EXPECT_EQ(LoadLittleEndian<uint16_t>(Row(glb, colors, i, 8) + 6), 65535);
    low = low.cwiseMin(mesh.positions[i]);
    high = high.cwiseMax(mesh.positions[i]);
  }
  for (int k = 0; k < 3; ++k) {
    EXPECT_EQ(positions["min"][k].get<float>(), low[k]);
    EXPECT_EQ(positions["max"][k].get<float>(), high[k]);
  }
  for (size_t i = 0; i < mesh.faces.size(); ++i) {
    for (size_t k = 0; k < 3; ++k) {
      ASSERT_EQ(LoadLittleEndian<uint32_t>(Row(glb, indices, 3 * i + k, 4)), mesh.faces[i][k]);
    }
  }
}

TEST_F(GlbTest, ColorsBecomeLinear) {
  TriangleMesh mesh;
  mesh.positions.assign(2, Eigen::Vector3f::Ones());
  mesh.colors = {{0, 255, 188}, {10, 11, 128}};
  const Glb glb = Write(mesh);
  const json& colors = glb.description["accessors"][1];
  EXPECT_TRUE(colors["normalized"].get<bool>());
  const auto channel = [&](size_t row, size_t k) {
    return LoadLittleEndian<uint16_t>(Row(glb, colors, row, 8) + 2 * k) / 65535.0;
  };
  EXPECT_EQ(channel(0, 0), 0);
  EXPECT_EQ(channel(0, 1), 1);
  EXPECT_NEAR(channel(0, 2), 0.5, 0.005);  // sRGB 188 is half the light
  EXPECT_NEAR(channel(1, 0), 10 / 255.0 / 12.92, 1e-5);
  EXPECT_NEAR(channel(1, 2), 0.2158, 1e-3);
}

TEST_F(GlbTest, NormalsAreUnitWhateverTheMeshSays) {
  TriangleMesh mesh;
  mesh.positions.assign(2, Eigen::Vector3f::Ones());
  mesh.normals = {Eigen::Vector3f::Zero(), Eigen::Vector3f(0, 3, 4)};
  const Glb glb = Write(mesh);
  const json& normals = glb.description["accessors"][1];
  EXPECT_FLOAT_EQ(VectorAt(Row(glb, normals, 0, 12)).norm(), 1);
  EXPECT_TRUE(VectorAt(Row(glb, normals, 1, 12)).isApprox(Eigen::Vector3f(0, 0.6F, 0.8F)));
}

TEST_F(GlbTest, PointCloudHasNoIndices) {
  TriangleMesh mesh;
  mesh.positions.assign(5, Eigen::Vector3f::Ones());
  const Glb glb = Write(mesh);
  const json& primitive = glb.description["meshes"][0]["primitives"][0];
  EXPECT_EQ(primitive["mode"], 0);
  EXPECT_FALSE(primitive.contains("indices"));
}

TEST_F(GlbTest, EmptyMeshIsASceneWithoutNodes) {
  const Glb glb = Write({});
  EXPECT_TRUE(glb.buffer.empty());
  EXPECT_FALSE(glb.description.contains("meshes"));
}

TEST_F(GlbTest, FolderThatDoesNotExistIsAnErrorThatNamesTheFile) {
  const absl::Status status = WriteGlb(TriangleMesh{}, "/nowhere/at/all.glb");
  EXPECT_NE(status.ToString().find("/nowhere/at/all.glb"), std::string::npos);
}

}  // namespace
}  // namespace meshwright
