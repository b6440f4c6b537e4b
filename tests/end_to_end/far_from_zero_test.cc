// Scenes in coordinates far from zero, as surveyors have them: the mesh is that of the scene near zero, moved.

#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/mesh/ply.h"
#include "common/scene/formats/export_colmap.h"
#include "common/scene/formats/import.h"
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
    for (size_t v = 0; v < far.positions.size(); ++v) {
      const Eigen::Vector3d x = far.positions[v].cast<double>() + far.offset - GetParam();
      EXPECT_LT((x - near.positions[v].cast<double>()).norm(), 0.003) << v;
    }
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
// SPDX-License-Identifier: Apache-2.0
