// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/formats/tileset.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "common/base/files.h"
#include "common/base/temporary_folder_testing.h"
#include "common/mesh/formats/glb_testing.h"
#include "common/mesh/formats/mesh_format.h"
#include "common/mesh/surface_mesh.h"
#include "common/surface/random_surface_testing.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr size_t kMaxFaces = 500;

class TilesetTest : public testing::Test {
 protected:
  TilesetTest() : mesh_(MeshOfSurface(RandomSurface(5, SmallCamera(80, 60), 1, 0.95, 0.95))) {}

  json Write(const std::string& name = "set/tileset.json") {
    const absl::Status status = WriteTileset(MeshRows(mesh_), folder_ / name, {.max_tile_faces = kMaxFaces});
    EXPECT_TRUE(status.ok()) << status;
    return json::parse(*ReadFile(folder_ / name));
  }

  // Calls visit(tile, parent) for every tile; the root has itself as parent.
  static void ForEach(const json& tile, const json& parent,
                      const std::function<void(const json&, const json&)>& visit) {
    visit(tile, parent);
    if (!tile.contains("children")) return;
    for (const json& child : tile["children"]) ForEach(child, tile, visit);
  }

  // Low and high corner.
  static Eigen::AlignedBox3d BoxOf(const json& tile) {
    const std::vector<double> box = tile["boundingVolume"]["box"];
    const Eigen::Vector3d center(box[0], box[1], box[2]);
    const Eigen::Vector3d half(box[3], box[7], box[11]);
    return {center - half, center + half};
  }

  // Positions of a tile's content as clients place them: by its node, then from Y up to Z up.
  std::vector<Eigen::Vector3d> PositionsOf(const json& tile, const std::string& beside = "set/") const {
    const Glb glb = SplitGlb(*ReadFile(folder_ / (beside + tile["content"]["uri"].get<std::string>())));
    const json& node = glb.description["nodes"][0];
    EXPECT_FALSE(node.contains("translation"));
    const std::vector<double> rotation = node["rotation"];
    const Eigen::Quaterniond turn(rotation[3], rotation[0], rotation[1], rotation[2]);
    const json& positions = glb.description["accessors"][0];
    std::vector<Eigen::Vector3d> placed;
    for (size_t i = 0; i < positions["count"].get<size_t>(); ++i) {
      const Eigen::Vector3d y_up = turn * VectorAt(Row(glb, positions, i, 12)).cast<double>();
      placed.emplace_back(y_up.x(), -y_up.z(), y_up.y());
    }
    return placed;
  }

  const TemporaryFolder folder_;
  TriangleMesh mesh_;
};

TEST_F(TilesetTest, BoxesHoldContentsAndChildrenAndErrorsFallToZero) {
  const json tileset = Write();
  EXPECT_EQ(tileset["asset"]["version"], "1.1");
  size_t tiles = 0;
  ForEach(tileset["root"], tileset["root"], [&](const json& tile, const json& parent) {
    ++tiles;
    const Eigen::AlignedBox3d box = BoxOf(tile);
    const double slack = 1e-9 * box.sizes().norm();
    const Eigen::AlignedBox3d grown(box.min().array() - slack, box.max().array() + slack);
    Eigen::AlignedBox3d tight;
    for (const Eigen::Vector3d& x : PositionsOf(tile)) {
      EXPECT_TRUE(grown.contains(x));
      tight.extend(x);
    }
    Eigen::AlignedBox3d of_parent = BoxOf(parent);
    EXPECT_TRUE(of_parent.extend(box).sizes().isApprox(BoxOf(parent).sizes(), 1e-9));
    EXPECT_LE(tile["geometricError"].get<double>(), parent["geometricError"].get<double>());
    EXPECT_EQ(tile["refine"], "REPLACE");
    if (tile.contains("children")) {
      EXPECT_GT(tile["geometricError"].get<double>(), 0);
    } else {
      EXPECT_EQ(tile["geometricError"].get<double>(), 0);
      EXPECT_TRUE(tight.sizes().isApprox(box.sizes(), 1e-9));
    }
  });
  EXPECT_GT(tiles, 20U);
  const auto files = std::distance(fs::directory_iterator(folder_ / "set/tileset.tiles"), fs::directory_iterator());
  EXPECT_EQ(files, static_cast<std::ptrdiff_t>(tiles));
  EXPECT_GT(tileset["geometricError"].get<double>(), tileset["root"]["geometricError"].get<double>());
  EXPECT_FALSE(tileset["root"].contains("transform"));
}

TEST_F(TilesetTest, FarFromZeroTheTransformGivesTheWorldsCoordinates) {
  mesh_.offset = {4121900, -652900, 4797700};
  const json tileset = Write();
  const std::vector<double> columns = tileset["root"]["transform"];
  const Eigen::Matrix4d world_from_tileset = Eigen::Map<const Eigen::Matrix4d>(columns.data());
  std::vector<std::array<double, 3>> found;
  ForEach(tileset["root"], tileset["root"], [&](const json& tile, const json&) {
    if (tile.contains("children")) return;
    for (const Eigen::Vector3d& x : PositionsOf(tile)) {
      const Eigen::Vector4d world = world_from_tileset * x.homogeneous();
      found.push_back({world.x(), world.y(), world.z()});
    }
  });
  std::vector<std::array<double, 3>> expected;
  const MeshRows rows(mesh_);
  for (size_t f = 0; f < rows.faces(); ++f) {
    for (const uint32_t v : rows.Face(f)) {
      const Eigen::Vector3d world = rows.WorldPosition(v);
      expected.push_back({world.x(), world.y(), world.z()});
    }
  }
  const auto make_set = [](auto& values) {
    std::sort(values.begin(), values.end());
    values.erase(std::unique(values.begin(), values.end()), values.end());
  };
  make_set(found);  // vertices on borders are in several tiles
  make_set(expected);
  ASSERT_EQ(found.size(), expected.size());
  for (size_t i = 0; i < found.size(); ++i) {
    for (size_t k = 0; k < 3; ++k) ASSERT_NEAR(found[i][k], expected[i][k], 1e-8);
  }
}

TEST_F(TilesetTest, ASmallMeshIsOneTile) {
  mesh_.faces.resize(kMaxFaces);
  const json root = Write()["root"];
  EXPECT_FALSE(root.contains("children"));
  EXPECT_EQ(root["geometricError"], 0.0);
}

TEST_F(TilesetTest, TheSameMeshGivesTheSameBytesAndReplacesWhatWasThere) {
  const auto bytes = [&](const std::string& folder) {
    std::map<std::string, std::string> files;
    for (const auto& entry : fs::recursive_directory_iterator(folder_ / folder)) {
      if (!entry.is_regular_file()) continue;
      files[fs::relative(entry.path(), folder_ / folder).string()] = *ReadFile(entry.path().string());
    }
    return files;
  };
  Write("a/tileset.json");
  Write("b/tileset.json");
  EXPECT_EQ(bytes("a"), bytes("b"));
  const TriangleMesh whole = mesh_;
  mesh_.faces.resize(4 * kMaxFaces);
  Write("b/tileset.json");
  EXPECT_LT(bytes("b").size(), bytes("a").size());
  mesh_ = whole;
  Write("b/tileset.json");
  EXPECT_EQ(bytes("a"), bytes("b"));
}

TEST_F(TilesetTest, CompressedContentsLieInTheirBoxes) {
  const auto path = folder_ / "set/tileset.json";
  ASSERT_TRUE(WriteTileset(MeshRows(mesh_), path, {.max_tile_faces = kMaxFaces, .compressed = true}).ok());
  const json root = json::parse(*ReadFile(path))["root"];
  ForEach(root, root, [&](const json& tile, const json& parent) {
    const Glb glb = SplitGlb(*ReadFile(folder_ / ("set/" + tile["content"]["uri"].get<std::string>())));
    const json& node = glb.description["nodes"][0];
    const json& positions = glb.description["accessors"][0];
    // Floats where faces reach far out of their cube.
    const auto translation = node.value("translation", std::vector<double>(3, 0));
    const double step = node.value("scale", std::vector<double>(3, 1))[0];
    const auto place = [&](const std::vector<double>& numbers) -> Eigen::Vector3d {
      const Eigen::Vector3d y_up(translation[0] + step * numbers[0], translation[1] - step * numbers[1],
                                 translation[2] - step * numbers[2]);
      return {y_up.x(), -y_up.z(), y_up.y()};
    };
    const Eigen::AlignedBox3d box = BoxOf(tile);
    EXPECT_TRUE(box.contains(place(positions["min"])));
    EXPECT_TRUE(box.contains(place(positions["max"])));
    EXPECT_TRUE(BoxOf(parent).extend(box).sizes().isApprox(BoxOf(parent).sizes(), 1e-9));
  });
}

TEST_F(TilesetTest, DustIsNotSeenFromAfar) {
  mesh_ = {};
  for (uint32_t i = 0; i < 2 * kMaxFaces; ++i) {
    const auto angle = static_cast<float>(i);
    const Eigen::Vector3f x(std::cos(angle), std::sin(angle), 0.01F * angle);
    for (int k = 0; k < 3; ++k) mesh_.positions.push_back(x + 1e-5F * Eigen::Vector3f::Unit(k));
    mesh_.faces.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  for (const bool compressed : {false, true}) {
    const auto path = folder_ / "set/tileset.json";
    ASSERT_TRUE(WriteTileset(MeshRows(mesh_), path, {.max_tile_faces = kMaxFaces, .compressed = compressed}).ok());
    const Glb root = SplitGlb(*ReadFile(folder_ / "set/tileset.tiles/r.glb"));
    EXPECT_FALSE(root.description.contains("meshes"));
  }
}

TEST_F(TilesetTest, NamesNeedNoEscapes) {
  const json tileset = Write("set/\xc3\xbc 1%.json");
  EXPECT_EQ(tileset["root"]["content"]["uri"], "___1_.tiles/r.glb");
  EXPECT_FALSE(PositionsOf(tileset["root"]).empty());
}

TEST_F(TilesetTest, FilesOfOthersAreNotReplaced) {
  folder_.Write("set/tileset.tiles/letter.txt", "dear");
  const absl::Status status = WriteTileset(MeshRows(mesh_), folder_ / "set/tileset.json");
  EXPECT_TRUE(absl::IsInvalidArgument(status));
  EXPECT_THAT(status.ToString(), testing::HasSubstr("letter.txt"));
  EXPECT_EQ(*ReadFile(folder_ / "set/tileset.tiles/letter.txt"), "dear");
}

TEST_F(TilesetTest, PointCloudsAreRefused) {
  mesh_.faces.clear();
  const absl::Status status = WriteTileset(MeshRows(mesh_), folder_ / "set/tileset.json");
  EXPECT_THAT(status.ToString(), testing::HasSubstr("0 faces"));
  EXPECT_FALSE(fs::exists(folder_ / "set"));
}

TEST_F(TilesetTest, ServicesAreToldThatItIsAFolder) {
  EXPECT_STREQ((*MeshFormatOfPath("a/tileset.json"))->name, "3d-tiles");
  const absl::Status status = MeshFormatByName("3d-tiles").status();
  EXPECT_THAT(status.ToString(), testing::HasSubstr("folder"));
  EXPECT_THAT(status.ToString(), testing::HasSubstr("ply, glb"));
}

}  // namespace
}  // namespace meshwright
