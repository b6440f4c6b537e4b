// SPDX-License-Identifier: Apache-2.0
// What is written for other programs, with the real ones where they are installed.

#include <cstdlib>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/mesh/ply.h"
#include "common/scene/formats/import.h"
#include "common/scene/view.h"
#include "tests/end_to_end/program.h"
#include "tests/end_to_end/running_service.h"

namespace meshwright::end_to_end {
namespace {

std::string WriteWorkspace(const std::string& program, const std::string& folder) {
  const std::string& scene = SharedScene("small");
  const RunResult result = RunMeshwright(
      {"workspace", scene, scene + "/ground_truth.ply", "--for", program, "-o", folder, "--max-image-size", "240"});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  return folder;
}

TEST(WorkspaceTest, ColmapFusesTheDepthMaps) {
  if (std::system("command -v colmap >/dev/null") != 0) GTEST_SKIP() << "colmap is not installed";
  const TemporaryFolder folder;
  const std::string workspace = WriteWorkspace("colmap", folder / "dense");
  const std::string fused = folder / "fused.ply";
  const std::string command = "colmap stereo_fusion --workspace_path " + workspace +
                              " --input_type geometric --output_path " + fused + " --StereoFusion.num_threads 2 >" +
                              (folder / "log") + " 2>&1";
  ASSERT_EQ(std::system(command.c_str()), 0) << ReadBytes(folder / "log");
  const TriangleMesh cloud = *ReadPly(fused);
  EXPECT_GT(cloud.positions.size(), 5'000U);
  const std::string& scene = SharedScene("small");
  const RunResult measured = RunMeshwright(
      {"evaluate", fused, scene + "/ground_truth.ply", "--scene", scene, "--max-image-size", "240", "--json"});
  ASSERT_EQ(measured.exit_code, 0) << measured.err;
  EXPECT_GT(JsonOf(measured)["precision"]["1"].get<double>(), 0.95);
  EXPECT_GT(JsonOf(measured)["recall"]["2"].get<double>(), 0.9);
}

TEST(WorkspaceTest, OpenMvsSceneHasTheSameCameras) {
  const TemporaryFolder folder;
  const std::string workspace = WriteWorkspace("openmvs", folder / "mvs");
  const absl::StatusOr<Scene> read = ImportScene(workspace, {.format = "openmvs"});
  ASSERT_TRUE(read.ok()) << read.status();
  const Scene scene = *ImportScene(SharedScene("small"));
  ASSERT_EQ(read->views.size(), scene.views.size());
  EXPECT_EQ(read->points.size(), scene.points.size());
  for (size_t i = 0; i < scene.views.size(); ++i) {
    const Camera a = UndistortedCamera(read->views[i], 0);
    const Camera b = UndistortedCamera(scene.views[i], 240);
    for (const SparsePoint& point : scene.points) {
      const Eigen::Vector2d pixel = b.ProjectFromCam(b.CamFromWorld(point.x_in_world));
      EXPECT_LT((a.ProjectFromCam(a.CamFromWorld(point.x_in_world)) - pixel).norm(), 1e-9);
    }
  }
  EXPECT_EQ(ReadPly(workspace + "/mesh.ply")->faces.size(),
            ReadPly(SharedScene("small") + "/ground_truth.ply")->faces.size());
}

}  // namespace
}  // namespace meshwright::end_to_end
