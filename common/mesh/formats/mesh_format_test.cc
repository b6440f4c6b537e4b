// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/formats/mesh_format.h"

#include <cmath>
#include <filesystem>
#include <sstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include "common/base/files.h"
#include "common/base/little_endian.h"
#include "common/mesh/surface_mesh.h"
#include "common/surface/random_surface_testing.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class MeshFormatTest : public testing::Test {
 protected:
  MeshFormatTest() : folder_(fs::path(testing::TempDir()) / ("meshwright_formats_" + std::to_string(::getpid()))) {
    fs::create_directories(folder_);
    mesh_ = MeshOfSurface(RandomSurface(3, SmallCamera(120, 90), 1, 0.8, 0.8));
    EXPECT_TRUE(WritePly(mesh_, At("mesh.ply")).ok());
  }
  ~MeshFormatTest() override { fs::remove_all(folder_); }

  std::string At(const std::string& name) const { return (folder_ / name).string(); }
  // The bytes of the mesh in the format that the ending says.
  std::string Convert(const std::string& name, bool points = false) {
    const auto format = MeshFormatOfPath(name);
    EXPECT_TRUE(format.ok()) << format.status();
    const absl::Status status = ConvertPly(At("mesh.ply"), **format, points, At(name));
    EXPECT_TRUE(status.ok()) << status;
    return *ReadFile(At(name));
  }

  fs::path folder_;
  TriangleMesh mesh_;
};

TEST_F(MeshFormatTest, EndingAndNameLeadToTheSameFormat) {
  size_t single_files = 0;
  for (const MeshFormat& format : MeshFormats()) {
    EXPECT_EQ(*MeshFormatOfPath(std::string("a.b/c") + format.ending), &format);
    if (format.has_folder) continue;
    EXPECT_EQ(*MeshFormatByName(format.name), &format);
    ++single_files;
  }
  EXPECT_EQ(*MeshFormatOfPath("MODEL.GLB"), *MeshFormatByName("glb"));
  EXPECT_TRUE(IsPly(MeshFormats().front()));
  EXPECT_EQ(nlohmann::json::parse(DescribeMeshFormats())["formats"].size(), single_files);
}

TEST_F(MeshFormatTest, UnknownEndingsAreToldWithThoseThatThereAre) {
  for (const char* path : {"mesh.fbx", "mesh", "a.ply/mesh", ""}) {
    const absl::Status status = MeshFormatOfPath(path).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << path;
    EXPECT_THAT(status.ToString(), HasSubstr(".ply, .glb, .obj"));
  }
}

TEST_F(MeshFormatTest, PlyStaysTheSameBytes) { EXPECT_EQ(Convert("copy.ply"), *ReadFile(At("mesh.ply"))); }

// Far from zero, where floats are half a unit apart.
class FarMeshTest : public MeshFormatTest {
 protected:
  FarMeshTest() {
    mesh_.offset = {500000, 4000000, -1234567.5};
    EXPECT_TRUE(WritePly(mesh_, At("mesh.ply")).ok());
  }
  Eigen::Vector3d World(size_t vertex) const { return mesh_.positions[vertex].cast<double>() + mesh_.offset; }
};

TEST_F(FarMeshTest, PlyHasDoublesAndGivesBackTheMesh) {
  EXPECT_EQ(Convert("copy.ply"), *ReadFile(At("mesh.ply")));
  EXPECT_THAT(Convert("copy.ply").substr(0, 200), HasSubstr("comment offset 500000 4000000 -1234567.5\n"));
  const TriangleMesh parsed = *ReadPly(At("mesh.ply"));
  const auto mapped = MeshRows::OpenPly(At("mesh.ply"));
  ASSERT_TRUE(mapped.ok()) << mapped.status();
  EXPECT_EQ(parsed.offset, mesh_.offset);
  EXPECT_EQ(mapped->offset(), mesh_.offset);
  for (size_t v = 0; v < mesh_.positions.size(); ++v) {
    EXPECT_LT((parsed.positions[v] - mesh_.positions[v]).norm(), 1e-6F);
    EXPECT_EQ(mapped->Position(v), parsed.positions[v]);
    EXPECT_LT((mapped->WorldPosition(v) - World(v)).norm(), 1e-8);
  }
}

TEST_F(FarMeshTest, DoublesOfOthersAreReadLessAnOffset) {
  std::string text =
      "ply\nformat ascii 1.0\nelement vertex 2\nproperty double x\nproperty double y\nproperty double z\n";
  ASSERT_TRUE(
      WriteFileAtomically(At("text.ply"), text + "end_header\n500012.25 4000003 1\n500012.375 4000002 2\n").ok());
  const TriangleMesh mesh = *ReadPly(At("text.ply"));
  EXPECT_EQ(mesh.offset, Eigen::Vector3d(500000, 4000000, 0));
  EXPECT_EQ(mesh.positions[1], Eigen::Vector3f(12.375F, 2, 2));
  ASSERT_TRUE(WriteFileAtomically(At("near.ply"), text + "end_header\n12.25 3 1\n12.375 2 2\n").ok());
  EXPECT_EQ(ReadPly(At("near.ply"))->offset, Eigen::Vector3d::Zero());
}

TEST_F(FarMeshTest, GlbHasTheOffsetInItsNode) {
  const std::string bytes = Convert("mesh.glb");
  const auto json = nlohmann::json::parse(bytes.substr(20, LoadLittleEndian<uint32_t>(bytes.data() + 12)));
  EXPECT_EQ(json["nodes"][0]["translation"], nlohmann::json({500000.0, -4000000.0, 1234567.5}));
  EXPECT_EQ(json["nodes"][0]["extras"]["offset"], nlohmann::json({500000.0, 4000000.0, -1234567.5}));
  EXPECT_LT(std::abs(json["accessors"][0]["max"][0].get<double>()), 1000);
}

TEST_F(FarMeshTest, ObjAndLasHaveTheWorldsCoordinates) {
  std::istringstream obj(Convert("mesh.obj"));
  std::string line;
  std::getline(obj, line);
  const std::string las = Convert("mesh.las");
  for (size_t v = 0; v < mesh_.positions.size(); ++v) {
    std::string word;
    Eigen::Vector3d x;
    std::getline(obj, line);
    std::istringstream(line) >> word >> x.x() >> x.y() >> x.z();
    EXPECT_LT((x - World(v)).norm(), 1e-8);
    for (int k = 0; k < 3; ++k) {
      const auto scale = LoadLittleEndian<double>(las.data() + 131 + 8 * k);
      const auto offset = LoadLittleEndian<double>(las.data() + 155 + 8 * k);
      const auto number = LoadLittleEndian<int32_t>(las.data() + 227 + 26 * v + 4 * static_cast<size_t>(k));
      EXPECT_NEAR(number * scale + offset, World(v)[k], 1e-6);
    }
  }
}

TEST_F(FarMeshTest, StlTellsTheOffset) {
  EXPECT_THAT(Convert("mesh.stl").substr(0, 80), HasSubstr("offset 500000 4000000 -1234567.5 "));
}

TEST_F(MeshFormatTest, AMappedFileAndOneThatIsParsedGiveTheSameRows) {
  std::string text = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
  text += "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0.5\n3 0 1 2\n";
  ASSERT_TRUE(WriteFileAtomically(At("text.ply"), text).ok());
  const auto parsed = MeshRows::OpenPly(At("text.ply"));
  ASSERT_TRUE(parsed.ok()) << parsed.status();
  ASSERT_EQ(parsed->vertices(), 3U);
  EXPECT_EQ(parsed->Position(2), Eigen::Vector3f(0, 1, 0.5F));
  EXPECT_EQ(parsed->Face(0), (std::array<uint32_t, 3>{0, 1, 2}));

  const auto mapped = MeshRows::OpenPly(At("mesh.ply"));
  ASSERT_TRUE(mapped.ok()) << mapped.status();
  ASSERT_EQ(mapped->vertices(), mesh_.positions.size());
  ASSERT_EQ(mapped->faces(), mesh_.faces.size());
  for (size_t v = 0; v < mesh_.positions.size(); ++v) {
    ASSERT_EQ(mapped->Position(v), mesh_.positions[v]);
    ASSERT_EQ(mapped->Normal(v), mesh_.normals[v]);
    ASSERT_EQ(mapped->Color(v), mesh_.colors[v]);
    ASSERT_EQ(mapped->Quality(v), mesh_.quality[v]);
    ASSERT_EQ(mapped->Camera(v), mesh_.cameras[v]);
  }
  for (size_t f = 0; f < mesh_.faces.size(); ++f) ASSERT_EQ(mapped->Face(f), mesh_.faces[f]);
}

TEST_F(MeshFormatTest, AnIndexBeyondTheVerticesIsRefused) {
  std::string bytes = *ReadFile(At("mesh.ply"));
  bytes.replace(bytes.size() - 4, 4, "\xff\xff\xff\x7f", 4);
  ASSERT_TRUE(WriteFileAtomically(At("mesh.ply"), bytes).ok());
  const absl::Status status = ConvertPly(At("mesh.ply"), **MeshFormatByName("stl"), false, At("mesh.stl"));
  EXPECT_THAT(status.ToString(), HasSubstr("below the number of vertices"));
  EXPECT_FALSE(fs::exists(At("mesh.stl")));
}

TEST_F(MeshFormatTest, AFileThatEndsEarlyIsRefused) {
  const std::string bytes = *ReadFile(At("mesh.ply"));
  ASSERT_TRUE(WriteFileAtomically(At("mesh.ply"), bytes.substr(0, bytes.size() - 5)).ok());
  EXPECT_FALSE(MeshRows::OpenPly(At("mesh.ply")).ok());
}

TEST_F(MeshFormatTest, StlHasTheTriangles) {
  const std::string bytes = Convert("mesh.stl");
  ASSERT_EQ(bytes.size(), 84 + 50 * mesh_.faces.size());
  EXPECT_EQ(LoadLittleEndian<uint32_t>(bytes.data() + 80), mesh_.faces.size());
  for (size_t f = 0; f < mesh_.faces.size(); ++f) {
    const auto at = [&](size_t number) { return LoadLittleEndian<float>(bytes.data() + 84 + 50 * f + 4 * number); };
    Eigen::Vector3f sides[2];
    for (size_t k = 0; k < 3; ++k) {
      const Eigen::Vector3f x(at(3 + 3 * k), at(4 + 3 * k), at(5 + 3 * k));
      ASSERT_EQ(x, mesh_.positions[mesh_.faces[f][k]]);
      if (k > 0) sides[k - 1] = x - mesh_.positions[mesh_.faces[f][0]];
    }
    const Eigen::Vector3f normal(at(0), at(1), at(2));
    EXPECT_NEAR(normal.norm(), 1, 1e-5);
    EXPECT_GT(normal.dot(sides[0].cross(sides[1])), 0);
  }
}

TEST_F(MeshFormatTest, StlOfPointsIsRefused) {
  const absl::Status status = ConvertPly(At("mesh.ply"), **MeshFormatByName("stl"), true, At("mesh.stl"));
  EXPECT_THAT(status.ToString(), HasSubstr("0 faces"));
  EXPECT_FALSE(fs::exists(At("mesh.stl")));
}

TEST_F(MeshFormatTest, ObjGivesBackTheSameFloats) {
  std::istringstream lines(Convert("mesh.obj"));
  size_t vertices = 0;
  size_t normals = 0;
  size_t faces = 0;
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string keyword;
    words >> keyword;
    if (keyword == "v") {
      float x = 0, y = 0, z = 0, r = 0, g = 0, b = 0;
      words >> x >> y >> z >> r >> g >> b;
      ASSERT_EQ(Eigen::Vector3f(x, y, z), mesh_.positions[vertices]);
      EXPECT_EQ(std::lround(255 * r), mesh_.colors[vertices][0]);
      EXPECT_EQ(std::lround(255 * b), mesh_.colors[vertices][2]);
      ++vertices;
    } else if (keyword == "vn") {
      ++normals;
    } else if (keyword == "f") {
      for (size_t k = 0; k < 3; ++k) {
        std::string corner;
        words >> corner;
        const std::string number = std::to_string(mesh_.faces[faces][k] + 1);
        ASSERT_EQ(corner, number + "//" + number);
      }
      ++faces;
    }
  }
  EXPECT_EQ(vertices, mesh_.positions.size());
  EXPECT_EQ(normals, mesh_.positions.size());
  EXPECT_EQ(faces, mesh_.faces.size());
}

TEST_F(MeshFormatTest, LasHasEveryVertexWhereItIs) {
  const std::string bytes = Convert("cloud.las");
  ASSERT_EQ(bytes.size(), 227 + 26 * mesh_.positions.size());
  EXPECT_EQ(bytes.substr(0, 4), "LASF");
  EXPECT_EQ(LoadLittleEndian<uint32_t>(bytes.data() + 96), 227U);
  EXPECT_EQ(LoadLittleEndian<uint32_t>(bytes.data() + 107), mesh_.positions.size());
  const auto number = [&](size_t offset) { return LoadLittleEndian<double>(bytes.data() + offset); };
  for (size_t v = 0; v < mesh_.positions.size(); ++v) {
    const char* point = bytes.data() + 227 + 26 * v;
    for (int k = 0; k < 3; ++k) {
      const double scale = number(131 + 8 * static_cast<size_t>(k));
      const double x = LoadLittleEndian<int32_t>(point + 4 * k) * scale + number(155 + 8 * static_cast<size_t>(k));
      ASSERT_NEAR(x, mesh_.positions[v][k], 0.51 * scale);
      EXPECT_LE(x, number(179 + 16 * static_cast<size_t>(k)));
      EXPECT_GE(x, number(187 + 16 * static_cast<size_t>(k)));
    }
    EXPECT_EQ(LoadLittleEndian<uint16_t>(point + 20), 257 * mesh_.colors[v][0]);
  }
}

TEST_F(MeshFormatTest, PointsAreTheVerticesAlone) {
  const std::string bytes = Convert("cloud.ply", true);
  const auto cloud = ParsePly(bytes, "cloud");
  ASSERT_TRUE(cloud.ok());
  EXPECT_EQ(cloud->positions, mesh_.positions);
  EXPECT_EQ(cloud->colors, mesh_.colors);
  EXPECT_TRUE(cloud->faces.empty());
}

}  // namespace
}  // namespace meshwright
