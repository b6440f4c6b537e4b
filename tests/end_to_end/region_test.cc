// SPDX-License-Identifier: Apache-2.0
// Masks and regions: what is hidden or outside is not in the mesh, and costs nothing.

#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/image/encode.h"
#include "common/mesh/ply.h"
#include "common/scene/formats/import.h"
#include "common/scene/formats/region_file.h"
#include "common/scene/view.h"
#include "tests/end_to_end/program.h"
#include "tests/end_to_end/running_service.h"

namespace meshwright::end_to_end {
namespace {

namespace fs = std::filesystem;

const std::vector<std::string> kQuick = {"--max-image-size", "240"};

nlohmann::json ReportOf(const std::string& scene, const std::string& output,
                        const std::vector<std::string>& options = {}) {
  const RunResult result = RunMeshwright(With(With({"reconstruct", scene, "-o", output, "--quiet"}, kQuick), options));
  EXPECT_EQ(result.exit_code, 0) << result.err;
  return nlohmann::json::parse(ReadBytes(fs::path(output).replace_extension(".report.json").string()), nullptr, false);
}

TEST(MaskTest, NothingOfTheMeshIsFromBehindAMask) {
  const TemporaryFolder folder;
  const std::string scene = folder / "scene";
  fs::copy(SharedScene("small"), scene, fs::copy_options::recursive);
  fs::create_directories(scene + "/masks");
  // Two photographs hide their left half, the others nothing.
  ColorImage mask{.width = 480, .height = 360, .rgb = {}};
  for (int i = 0; i < 480 * 360; ++i) mask.rgb.insert(mask.rgb.end(), 3, i % 480 < 240 ? 0 : 255);
  for (const char* name : {"0003.png", "0005.png"}) {
    ASSERT_TRUE(WritePng(scene + "/masks/" + name + ".png", mask).ok());
  }
  ReportOf(scene, folder / "masked.ply");
  ReportOf(SharedScene("small"), folder / "whole.ply");
  const auto from_behind = [&](const std::string& path) {
    const Scene read = *ImportScene(SharedScene("small"));
    const TriangleMesh mesh = *ReadPly(path);
    int64_t count = 0;
    for (size_t v = 0; v < mesh.positions.size(); ++v) {
      if (mesh.cameras[v] != 3 && mesh.cameras[v] != 5) continue;
      const Camera camera = UndistortedCamera(read.views[static_cast<size_t>(mesh.cameras[v])], 240);
      const Eigen::Vector2d pixel = camera.ProjectFromCam(camera.CamFromWorld(mesh.positions[v].cast<double>()));
      if (pixel.x() < 120) ++count;
    }
    return count;
  };
  EXPECT_GT(from_behind(folder / "whole.ply"), 100);
  EXPECT_EQ(from_behind(folder / "masked.ply"), 0);
  EXPECT_EQ(JsonOf(RunMeshwright({"inspect", scene, "--json"}))["masks"], 2);

  WriteBytes(scene + "/masks/0004.png.png", "no picture");
  const RunResult damaged =
      RunMeshwright(With({"reconstruct", scene, "-o", folder / "damaged.ply", "--quiet"}, kQuick));
  EXPECT_EQ(damaged.exit_code, 3);
  EXPECT_THAT(damaged.err, testing::HasSubstr("masks/0004.png.png"));
}

// A box around the middle of what the sparse points show, with a tenth of the surface.
std::string SmallRegion(const std::string& path) {
  const Scene scene = *ImportScene(SharedScene("small"));
  OrientedBox box = *RegionOfPoints(scene);
  box.size.x() *= 0.33;  // the front's width and height; its depth is y
  box.size.z() *= 0.33;
  box.size.y() *= 2;
  WriteBytes(path, nlohmann::json({box.center.x() - box.size.x() / 2, box.center.y() - box.size.y() / 2,
                                   box.center.z() - box.size.z() / 2, box.center.x() + box.size.x() / 2,
                                   box.center.y() + box.size.y() / 2, box.center.z() + box.size.z() / 2})
                       .dump());
  return path;
}

TEST(RegionTest, OnlyWhatIsInsideIsReconstructedAndItTakesLess) {
  const TemporaryFolder folder;
  const std::string region = SmallRegion(folder / "box.json");
  const OrientedBox box = *ReadRegion(region);
  const nlohmann::json whole = ReportOf(SharedScene("small"), folder / "whole.ply");
  const nlohmann::json part = ReportOf(SharedScene("small"), folder / "part.ply", {"--region", region});
  const TriangleMesh mesh = *ReadPly(folder / "part.ply");
  ASSERT_FALSE(mesh.faces.empty());
  const double slack = 1e-2 * box.size.maxCoeff();  // smoothing moves vertices a little
  OrientedBox grown = box;
  grown.size.array() += slack;
  for (const Eigen::Vector3f& x : mesh.positions) EXPECT_TRUE(grown.Contains(x.cast<double>())) << x.transpose();
  const auto scored = [](const nlohmann::json& report) {
    return report["totals"]["tentative_patches_scored"].get<double>();
  };
  EXPECT_LT(scored(part), 0.3 * scored(whole));

  // The same part as cutting it out afterwards gives, but for its border.
  const RunResult cropped = RunMeshwright({"crop", folder / "whole.ply", "--region", region, "-o", folder / "cut.ply"});
  ASSERT_EQ(cropped.exit_code, 0) << cropped.err;
  const TriangleMesh cut = *ReadPly(folder / "cut.ply");
  for (const Eigen::Vector3f& x : cut.positions) EXPECT_TRUE(box.Contains(x.cast<double>()));
  EXPECT_NEAR(mesh.faces.size(), cut.faces.size(), 0.15 * static_cast<double>(cut.faces.size()));
}

TEST(RegionTest, TheServiceTakesItWithTheScene) {
  RunningService service;
  const std::string region = SmallRegion(service.folder() / "box.json");
  const std::vector<std::string> options = With(kQuick, {"--region", region});
  const auto coordinator = service.StartCoordinator();
  const auto worker = service.StartWorker("first");
  ASSERT_EQ(service.Client(With({"submit", SharedScene("small"), "--id", "part"}, options)).exit_code, 0);
  EXPECT_TRUE(service.WaitForMesh("part") == service.LocalMesh(SharedScene("small"), options));
}

TEST(CropTest, SaysWhatIsWrong) {
  const TemporaryFolder folder;
  WriteBytes(folder / "far.json", "[1e6, 1e6, 1e6, 2e6, 2e6, 2e6]");
  const RunResult nothing = RunMeshwright(
      {"crop", SharedScene("small") + "/ground_truth.ply", "--region", folder / "far.json", "-o", folder / "x.ply"});
  EXPECT_EQ(nothing.exit_code, 3);
  EXPECT_THAT(nothing.err, testing::HasSubstr("is in the box"));
  const RunResult no_file = RunMeshwright(
      {"crop", SharedScene("small") + "/ground_truth.ply", "--region", folder / "none.json", "-o", folder / "x.ply"});
  EXPECT_EQ(no_file.exit_code, 3);
}

}  // namespace
}  // namespace meshwright::end_to_end
