// SPDX-License-Identifier: Apache-2.0
// Scenes in coordinates far from zero, as surveyors have them: the mesh is that of the scene near zero, moved.

#include <algorithm>
#include <array>
#include <filesystem>
#include <limits>
#include <map>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/base/little_endian.h"
#include "common/mesh/ply.h"
#include "common/scene/formats/export_colmap.h"
#include "common/scene/formats/import.h"
#include "common/scene/view.h"
#include "tests/end_to_end/program.h"
#include "tests/end_to_end/running_service.h"

namespace meshwright::end_to_end {
namespace {

const Eigen::Vector3d kUtm(500000, 4000000, 0);
const Eigen::Vector3d kEcef(4121967.5, 652927.25, 4797731.125);
const std::vector<std::string> kQuick = {"--max-image-size", "160"};

// The small scene with all coordinates moved.
std::string MovedScene(const Eigen::Vector3d& by, const std::string& folder) {
  Scene scene = *ImportScene(SharedScene("small"));
  scene.offset = by;
  EXPECT_TRUE(ExportColmapText(scene, folder + "/model").ok());
  std::filesystem::create_symlink(SharedScene("small") + "/images", folder + "/images");
  return folder;
}

TriangleMesh Reconstruct(const std::string& scene, const std::string& output) {
  const RunResult result = RunMeshwright(With({"reconstruct", scene, "-o", output, "--quiet"}, kQuick));
  EXPECT_EQ(result.exit_code, 0) << result.err;
  return *ReadPly(output);
}

// The smallest pixel footprint z / f among the vertices, each in its own photograph.
double SmallestFootprint(const TriangleMesh& mesh) {
  const Scene scene = *ImportScene(SharedScene("small"));
  double smallest = std::numeric_limits<double>::max();
  for (size_t v = 0; v < mesh.positions.size(); ++v) {
    const Camera camera = UndistortedCamera(scene.views[static_cast<size_t>(mesh.cameras[v])], 160);
    const double z = camera.CamFromWorld(mesh.positions[v].cast<double>() + mesh.offset).z();
    smallest = std::min(smallest, z / camera.fx);
  }
  return smallest;
}

std::vector<Eigen::Vector3d> PositionsOfPly(const std::string& path) {
  const TriangleMesh mesh = *ReadPly(path);
  std::vector<Eigen::Vector3d> positions;
  for (const Eigen::Vector3f& x : mesh.positions) positions.emplace_back(x.cast<double>() + mesh.offset);
  return positions;
}

std::vector<Eigen::Vector3d> PositionsOfObj(const std::string& path) {
  std::istringstream lines(ReadBytes(path));
  std::vector<Eigen::Vector3d> positions;
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with("v ")) continue;
    Eigen::Vector3d& x = positions.emplace_back();
    std::istringstream(line.substr(2)) >> x.x() >> x.y() >> x.z();
  }
  return positions;
}

std::vector<Eigen::Vector3d> PositionsOfLas(const std::string& path) {
  const std::string bytes = ReadBytes(path);
  std::vector<Eigen::Vector3d> positions(LoadLittleEndian<uint32_t>(bytes.data() + 107));
  for (size_t v = 0; v < positions.size(); ++v) {
    for (size_t k = 0; k < 3; ++k) {
      positions[v][static_cast<int>(k)] = LoadLittleEndian<int32_t>(bytes.data() + 227 + 26 * v + 4 * k) *
                                              LoadLittleEndian<double>(bytes.data() + 131 + 8 * k) +
                                          LoadLittleEndian<double>(bytes.data() + 155 + 8 * k);
    }
  }
  return positions;
}

// As clients of glTF place them: by the node, Y up.
std::vector<Eigen::Vector3d> PlacedPositions(const std::string& path) {
  const std::string bytes = ReadBytes(path);
  const auto json_bytes = LoadLittleEndian<uint32_t>(bytes.data() + 12);
  const auto json = nlohmann::json::parse(bytes.substr(20, json_bytes));
  const nlohmann::json& node = json["nodes"][0];
  const auto translation = node.value("translation", std::vector<double>(3, 0));
  const std::vector<double> rotation = node["rotation"];
  const Eigen::Quaterniond turn(rotation[3], rotation[0], rotation[1], rotation[2]);
  std::vector<Eigen::Vector3d> positions(json["accessors"][0]["count"].get<size_t>());
  for (size_t v = 0; v < positions.size(); ++v) {
    const char* const row = bytes.data() + 28 + json_bytes + 12 * v;
    const Eigen::Vector3f x(LoadLittleEndian<float>(row), LoadLittleEndian<float>(row + 4),
                            LoadLittleEndian<float>(row + 8));
    positions[v] = turn * x.cast<double>() + Eigen::Vector3d(translation[0], translation[1], translation[2]);
  }
  return positions;
}

// Our node turns half around X for viewers: turned back.
std::vector<Eigen::Vector3d> PositionsOfGlb(const std::string& path) {
  std::vector<Eigen::Vector3d> positions = PlacedPositions(path);
  for (Eigen::Vector3d& x : positions) x = {x.x(), -x.y(), -x.z()};
  return positions;
}

// As clients of 3D Tiles place them: contents from Y up to Z up, then the root's transform. The mesh is one tile.
std::vector<Eigen::Vector3d> PositionsOfTileset(const std::string& path) {
  const auto root = nlohmann::json::parse(ReadBytes(path))["root"];
  EXPECT_FALSE(root.contains("children"));
  const std::vector<double> columns = root["transform"];
  const Eigen::Matrix4d world_from_tileset = Eigen::Map<const Eigen::Matrix4d>(columns.data());
  const std::string content = root["content"]["uri"];
  std::vector<Eigen::Vector3d> positions =
      PlacedPositions((std::filesystem::path(path).parent_path() / content).string());
  for (Eigen::Vector3d& x : positions) {
    x = (world_from_tileset * Eigen::Vector3d(x.x(), -x.z(), x.y()).homogeneous()).head<3>();
  }
  return positions;
}

// How many of the points have none of the others within a distance.
size_t CountFarther(const std::vector<Eigen::Vector3d>& points, const std::vector<Eigen::Vector3d>& others,
                    double distance) {
  using Cell = std::array<int64_t, 3>;
  const Eigen::Vector3d origin = others.front();
  const auto cell_of = [&](const Eigen::Vector3d& x, const Eigen::Vector3d& step) -> Cell {
    const Eigen::Vector3d in_cells = ((x - origin) / distance + step).array().floor();
    return {static_cast<int64_t>(in_cells.x()), static_cast<int64_t>(in_cells.y()), static_cast<int64_t>(in_cells.z())};
  };
  std::multimap<Cell, const Eigen::Vector3d*> cells;
  for (const Eigen::Vector3d& x : others) cells.emplace(cell_of(x, Eigen::Vector3d::Zero()), &x);
  const auto has_near = [&](const Eigen::Vector3d& x) {
    for (int i = 0; i < 27; ++i) {
      const auto [begin, end] = cells.equal_range(cell_of(x, Eigen::Vector3d(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1)));
      if (std::any_of(begin, end, [&](const auto& entry) { return (*entry.second - x).norm() <= distance; })) {
        return true;
      }
    }
    return false;
  };
  return static_cast<size_t>(std::ranges::count_if(points, [&](const auto& x) { return !has_near(x); }));
}

class FarFromZeroTest : public testing::TestWithParam<Eigen::Vector3d> {};

TEST_P(FarFromZeroTest, TheMeshIsMovedAndNothingElse) {
  const TemporaryFolder folder;
  const TriangleMesh near = Reconstruct(SharedScene("small"), folder / "near.ply");
  const TriangleMesh far = Reconstruct(MovedScene(GetParam(), folder / "far"), folder / "far.ply");
  EXPECT_TRUE(near.offset.isZero(0));
  EXPECT_FALSE(far.offset.isZero(0));
  // Poses differ in their last digits, so a few patches may be others.
  const auto few = [](size_t count) { return 0.01 * static_cast<double>(count); };
  EXPECT_NEAR(far.positions.size(), near.positions.size(), few(near.positions.size()));
  EXPECT_NEAR(far.faces.size(), near.faces.size(), few(near.faces.size()));
  if (far.positions.size() == near.positions.size()) {
    size_t moved = 0;
    for (size_t v = 0; v < far.positions.size(); ++v) {
      const Eigen::Vector3d x = far.positions[v].cast<double>() + far.offset - GetParam();
      moved += (x - near.positions[v].cast<double>()).norm() > 0.003 ? 1 : 0;
    }
    EXPECT_LE(static_cast<double>(moved), few(near.positions.size()));
  }
  for (const auto& face : far.faces) {
    const Eigen::Vector3f& a = far.positions[face[0]];
    EXPECT_GT((far.positions[face[1]] - a).cross(far.positions[face[2]] - a).norm(), 0);
  }
  const RunResult measured = RunMeshwright({"evaluate", folder / "far.ply", folder / "far.ply", "--scene",
                                            folder / "far", "--max-image-size", "160", "--json"});
  ASSERT_EQ(measured.exit_code, 0) << measured.err;
  EXPECT_GT(JsonOf(measured)["f_score"]["1"].get<double>(), 0.999);
  const nlohmann::json report = nlohmann::json::parse(ReadBytes(folder / "far.report.json"));
  EXPECT_EQ(report["scene"]["offset"][1], far.offset.y());
}

TEST_P(FarFromZeroTest, EveryFormatHasTheMeshOfNearToAThousandthOfAPixel) {
  const TemporaryFolder folder;
  const TriangleMesh near = Reconstruct(SharedScene("small"), folder / "near.ply");
  const std::string far = folder / "far.ply";
  Reconstruct(MovedScene(GetParam(), folder / "far"), far);
  const double tolerance = 1e-3 * SmallestFootprint(near);
  std::vector<Eigen::Vector3d> expected;
  for (const Eigen::Vector3f& x : near.positions) expected.emplace_back(x.cast<double>() + GetParam());

  using Reader = std::vector<Eigen::Vector3d> (*)(const std::string&);
  const std::vector<std::pair<const char*, Reader>> formats = {{"far.ply", PositionsOfPly},
                                                               {"mesh.obj", PositionsOfObj},
                                                               {"mesh.las", PositionsOfLas},
                                                               {"mesh.glb", PositionsOfGlb},
                                                               {"tiles/tileset.json", PositionsOfTileset}};
  for (const auto& [name, read] : formats) {
    SCOPED_TRACE(name);
    const std::string path = folder / name;
    if (path != far) {
      const RunResult converted = RunMeshwright({"convert", far, "-o", path});
      ASSERT_EQ(converted.exit_code, 0) << converted.err;
    }
    const std::vector<Eigen::Vector3d> positions = read(path);
    ASSERT_FALSE(positions.empty());
    // Poses that were written far from zero differ in their last digits, and some patches settle elsewhere; so do, by a
    // little, those of other cameras that are averaged with them.
    const double few = 0.08 * static_cast<double>(expected.size());
    EXPECT_LE(CountFarther(positions, expected, tolerance), few);
    EXPECT_LE(CountFarther(expected, positions, tolerance), few);
    // Nothing is lost on the way from the PLY.
    EXPECT_EQ(CountFarther(positions, PositionsOfPly(far), tolerance), 0U);
  }
}

TEST_P(FarFromZeroTest, StlTellsTheOffsetThatItCannotCarry) {
  const TemporaryFolder folder;
  const std::string far = folder / "far.ply";
  const TriangleMesh mesh = Reconstruct(MovedScene(GetParam(), folder / "far"), far);
  ASSERT_EQ(RunMeshwright({"convert", far, "-o", folder / "mesh.stl"}).exit_code, 0);
  const std::string bytes = ReadBytes(folder / "mesh.stl");
  std::istringstream header(bytes.substr(std::string("Meshwright offset").size(), 60));
  Eigen::Vector3d offset;
  header >> offset.x() >> offset.y() >> offset.z();
  EXPECT_EQ(offset, mesh.offset);
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    const char* const corner = bytes.data() + 84 + 50 * f + 12;
    const Eigen::Vector3f x(LoadLittleEndian<float>(corner), LoadLittleEndian<float>(corner + 4),
                            LoadLittleEndian<float>(corner + 8));
    ASSERT_LT((x - mesh.positions[mesh.faces[f][0]]).norm(), 1e-5F);
  }
}

INSTANTIATE_TEST_SUITE_P(Frames, FarFromZeroTest, testing::Values(kUtm, kEcef));

TEST(FarFromZeroServiceTest, TheServiceGivesTheSameBytes) {
  RunningService service;
  const std::string scene = MovedScene(kUtm, service.folder() / "far");
  const auto coordinator = service.StartCoordinator();
  const auto worker = service.StartWorker("first");
  ASSERT_EQ(service.Client(With({"submit", scene, "--id", "far"}, kQuick)).exit_code, 0);
  EXPECT_TRUE(service.WaitForMesh("far") == service.LocalMesh(scene, kQuick));
}

}  // namespace
}  // namespace meshwright::end_to_end
