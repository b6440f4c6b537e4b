// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/formats/glb_compression.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <meshoptimizer.h>

#include "common/base/files.h"
#include "common/base/temporary_folder_testing.h"
#include "common/mesh/formats/glb.h"
#include "common/mesh/formats/glb_testing.h"
#include "common/mesh/formats/textured_mesh_writer.h"
#include "common/mesh/surface_mesh.h"
#include "common/surface/random_surface_testing.h"

namespace meshwright {
namespace {

using nlohmann::json;

// What decoders make of an accessor's view: its rows.
std::string Decode(const Glb& glb, const json& accessor) {
  const json& view = glb.description["bufferViews"][accessor["bufferView"].get<size_t>()];
  const json& compressed = view["extensions"]["EXT_meshopt_compression"];
  const auto count = compressed["count"].get<size_t>();
  const auto stride = compressed["byteStride"].get<size_t>();
  EXPECT_EQ(count, accessor["count"]);
  EXPECT_EQ(view["byteLength"], count * stride);
  EXPECT_LE(view["byteOffset"].get<size_t>() + count * stride,
            glb.description["buffers"][1]["byteLength"].get<size_t>());
  const auto offset = compressed["byteOffset"].get<size_t>();
  const auto bytes = compressed["byteLength"].get<size_t>();
  EXPECT_LE(offset + bytes, glb.buffer.size());
  std::string rows(count * stride, '\0');
  const auto* const from = reinterpret_cast<const unsigned char*>(glb.buffer.data() + offset);
  const bool is_vertices = compressed["mode"] == "ATTRIBUTES";
  EXPECT_EQ(from[0], is_vertices ? 0xa0 : 0xe1);  // the versions of the extension
  const int failed = is_vertices ? meshopt_decodeVertexBuffer(rows.data(), count, stride, from, bytes)
                                 : meshopt_decodeIndexBuffer(rows.data(), count, stride, from, bytes);
  EXPECT_EQ(failed, 0);
  return rows;
}

class GlbCompressionTest : public testing::Test {
 protected:
  Glb Write(const TriangleMesh& mesh) {
    const absl::Status status = WriteCompressedGlb(MeshRows(mesh), folder_ / "mesh.glb");
    EXPECT_TRUE(status.ok()) << status;
    return SplitGlb(*ReadFile(folder_ / "mesh.glb"));
  }
  static const json& Attribute(const Glb& glb, const char* name) {
    return glb
        .description["accessors"][glb.description["meshes"][0]["primitives"][0]["attributes"][name].get<size_t>()];
  }
  // Positions as the node places them, turned back to the scene's axes.
  static std::vector<Eigen::Vector3d> Positions(const Glb& glb) {
    const json& accessor = Attribute(glb, "POSITION");
    const std::string rows = Decode(glb, accessor);
    const json& node = glb.description["nodes"][0];
    const auto step = node["scale"][0].get<double>();
    const std::vector<double> translation = node["translation"];
    std::vector<Eigen::Vector3d> positions;
    for (size_t v = 0; v < accessor["count"]; ++v) {
      Eigen::Vector3d x;
      for (int k = 0; k < 3; ++k) {
        const auto number = LoadLittleEndian<uint16_t>(rows.data() + 8 * v + 2 * static_cast<size_t>(k));
        EXPECT_LE(number, accessor["max"][static_cast<size_t>(k)]);
        EXPECT_GE(number, accessor["min"][static_cast<size_t>(k)]);
        x[k] = step * number + (k == 0 ? 1 : -1) * translation[static_cast<size_t>(k)];
      }
      positions.push_back(x);
    }
    return positions;
  }

  const TemporaryFolder folder_;
  const TriangleMesh mesh_ = MeshOfSurface(RandomSurface(1, SmallCamera(200, 150), 1, 0.8, 0.8));
};

// Corners on the lattice, and colours, in any order and from any corner.
using Corner = std::array<int64_t, 6>;
std::array<Corner, 3> FromSmallest(std::array<Corner, 3> triangle) {
  std::rotate(triangle.begin(), std::min_element(triangle.begin(), triangle.end()), triangle.end());
  return triangle;
}

TEST_F(GlbCompressionTest, HoldsEveryTriangleWithinAStep) {
  const Glb glb = Write(mesh_);
  const auto step = glb.description["nodes"][0]["scale"][0].get<double>();
  const auto bounds = MeshRows(mesh_).FindBounds();
  EXPECT_LT(step, (bounds.high - bounds.low).maxCoeff() / 32000);
  const glb::PositionLattice lattice = glb::LatticeFor(bounds.low, bounds.high, mesh_.positions.size());
  EXPECT_EQ(step, lattice.step);
  const auto corner = [&](const Eigen::Vector3d& x, uint16_t red, uint16_t green, uint16_t blue) -> Corner {
    const Eigen::Vector3d k = ((x - lattice.origin) / step).array().round();
    return {static_cast<int64_t>(k.x()), static_cast<int64_t>(k.y()), static_cast<int64_t>(k.z()), red, green, blue};
  };
  std::multiset<std::array<Corner, 3>> expected;
  std::multiset<std::array<Corner, 3>> found;
  const TriangleMesh& m = mesh_;
  ASSERT_TRUE(WriteGlb(m, folder_ / "plain.glb").ok());
  const Glb plain = SplitGlb(*ReadFile(folder_ / "plain.glb"));
  for (const auto& face : m.faces) {
    std::array<Corner, 3> triangle;
    for (size_t i = 0; i < 3; ++i) {
      const char* const color = Row(plain, Attribute(plain, "COLOR_0"), face[i], 8);
      triangle[i] = corner(m.positions[face[i]].cast<double>(), LoadLittleEndian<uint16_t>(color),
                           LoadLittleEndian<uint16_t>(color + 2), LoadLittleEndian<uint16_t>(color + 4));
    }
    expected.insert(FromSmallest(triangle));
  }
  const std::vector<Eigen::Vector3d> positions = Positions(glb);
  const std::string colors = Decode(glb, Attribute(glb, "COLOR_0"));
  const json& indices =
      glb.description["accessors"][glb.description["meshes"][0]["primitives"][0]["indices"].get<size_t>()];
  ASSERT_EQ(indices["componentType"], glb::kUnsignedShort);
  const std::string corners = Decode(glb, indices);
  for (size_t f = 0; f < m.faces.size(); ++f) {
    std::array<Corner, 3> triangle;
    for (size_t i = 0; i < 3; ++i) {
      const auto v = LoadLittleEndian<uint16_t>(corners.data() + 6 * f + 2 * i);
      const char* const color = colors.data() + 8 * size_t{v};
      triangle[i] = corner(positions[v], LoadLittleEndian<uint16_t>(color), LoadLittleEndian<uint16_t>(color + 2),
                           LoadLittleEndian<uint16_t>(color + 4));
    }
    found.insert(FromSmallest(triangle));
  }
  EXPECT_EQ(found, expected);
  EXPECT_LT(glb.buffer.size(), plain.buffer.size() / 2);
}

TEST_F(GlbCompressionTest, NormalsAreKeptToAPercent) {
  TriangleMesh cloud;
  cloud.positions = mesh_.positions;
  cloud.normals = mesh_.normals;
  const Glb glb = Write(cloud);
  EXPECT_EQ(glb.description["meshes"][0]["primitives"][0]["mode"], glb::kPoints);
  const std::string rows = Decode(glb, Attribute(glb, "NORMAL"));
  ASSERT_EQ(rows.size(), 4 * cloud.normals.size());
  for (size_t v = 0; v < cloud.normals.size(); ++v) {
    for (size_t k = 0; k < 3; ++k) {
      EXPECT_NEAR(LoadLittleEndian<int8_t>(rows.data() + 4 * v + k) / 127.0, mesh_.normals[v][static_cast<int>(k)],
                  0.005);
    }
  }
}

TEST_F(GlbCompressionTest, FarFromZeroOnlyTheNodeKnows) {
  TriangleMesh far = mesh_;
  far.offset = {500000, 4000000, -1234567.5};
  const Glb there = Write(far);
  const Glb here = Write(mesh_);
  EXPECT_EQ(there.buffer, here.buffer);
  const std::vector<Eigen::Vector3d> from = Positions(here);
  const std::vector<Eigen::Vector3d> to = Positions(there);
  for (size_t v = 0; v < from.size(); ++v) EXPECT_LT((to[v] - from[v] - far.offset).norm(), 1e-8);
  EXPECT_EQ(there.description["nodes"][0]["extras"]["offset"], json({500000.0, 4000000.0, -1234567.5}));
}

TEST_F(GlbCompressionTest, LatticesSpanTheirBoundsWithPowersOfTwo) {
  for (const float extent : {1e-3F, 0.7F, 1.0F, 65534.0F, 65535.0F, 1e6F}) {
    const Eigen::Vector3f low(-0.3F * extent, 5, -7);
    const glb::PositionLattice lattice = glb::LatticeFor(low, low + Eigen::Vector3f(extent, extent / 2, 0), 1000);
    EXPECT_EQ(std::exp2(std::round(std::log2(lattice.step))), lattice.step);
    EXPECT_LE(lattice.step, 2.01 * extent / 65534);
    EXPECT_GE(std::round((low.x() - lattice.origin.x()) / lattice.step), 0);
    EXPECT_LE(std::round((low.x() + double{extent} - lattice.origin.x()) / lattice.step), 65535);
  }
  EXPECT_EQ(glb::LatticeFor(Eigen::Vector3f::Zero(), Eigen::Vector3f::Ones(), (1 << 24) + 1).step, 0);
}

TEST_F(GlbCompressionTest, FloatsStayWhatTheyAreWithoutALattice) {
  const glb::CompressedPrimitive primitive(
      {.positions = mesh_.positions, .normals = {}, .colors = {}, .texture_coordinates = {}, .faces = {}}, {});
  Glb glb;
  glb::Description description = glb::NewDescription();
  primitive.Describe(description);
  glb::DescribeCompressedBuffers(description);
  glb.description = description.gltf;
  glb.buffer = primitive.bytes();
  const std::string rows = Decode(glb, glb.description["accessors"][0]);
  for (size_t v = 0; v < mesh_.positions.size(); ++v) ASSERT_EQ(VectorAt(rows.data() + 12 * v), mesh_.positions[v]);
}

TEST_F(GlbCompressionTest, TexturedPartsAreOnOneLatticeWithTheirPicturesBehindThem) {
  std::vector<TexturePart> parts(2);
  parts[0] = {.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}},
              .texture_coordinates = {{0, 0}, {1, 0}, {0, 0.25F}},
              .faces = {{0, 1, 2}}};
  parts[1] = {.positions = {{5, 5, 5}, {6, 5, 5}, {5, 6, 7}},
              .texture_coordinates = {{0.5F, 0.5F}, {1, 0}, {0, 1}},
              .faces = {{0, 1, 2}}};
  const auto writer = TexturedMeshWriter::Create(**MeshFormatByName("glb"), folder_ / "textured.glb", parts,
                                                 Eigen::Vector3d::Zero(), {}, {.compressed = true});
  ASSERT_TRUE(writer.ok()) << writer.status();
  const ColorImage page{.width = 8, .height = 8, .rgb = std::vector<uint8_t>(size_t{3} * 8 * 8, 100)};
  for (int i = 0; i < 2; ++i) ASSERT_TRUE((*writer)->AppendPage(page).ok());
  ASSERT_TRUE((*writer)->Commit().ok());
  const Glb glb = SplitGlb(*ReadFile(folder_ / "textured.glb"));
  const auto step = glb.description["nodes"][0]["scale"][0].get<double>();
  for (size_t i = 0; i < parts.size(); ++i) {
    const json& attributes = glb.description["meshes"][0]["primitives"][i]["attributes"];
    const auto rows = [&](const char* name) {
      return Decode(glb, glb.description["accessors"][attributes[name].get<size_t>()]);
    };
    const std::string positions = rows("POSITION");
    const std::string coordinates = rows("TEXCOORD_0");
    for (size_t v = 0; v < 3; ++v) {
      EXPECT_NEAR(step * LoadLittleEndian<uint16_t>(positions.data() + 8 * v), parts[i].positions[v].x(), step);
      for (size_t k = 0; k < 2; ++k) {
        EXPECT_NEAR(LoadLittleEndian<uint16_t>(coordinates.data() + 4 * v + 2 * k) / 65535.0,
                    parts[i].texture_coordinates[v][static_cast<int>(k)], 1e-5);
      }
    }
    const json& picture = glb.description["bufferViews"][glb.description["images"][i]["bufferView"].get<size_t>()];
    EXPECT_EQ(picture["buffer"], 0);
    EXPECT_EQ(glb.buffer.substr(picture["byteOffset"].get<size_t>(), 2), "\xff\xd8");  // JPEG
  }
}

TEST_F(GlbCompressionTest, AnEmptyMeshIsASceneWithoutNodes) { EXPECT_FALSE(Write({}).description.contains("meshes")); }

}  // namespace
}  // namespace meshwright
