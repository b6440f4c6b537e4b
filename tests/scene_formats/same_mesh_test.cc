// SPDX-License-Identifier: Apache-2.0
// The same scene through every importer gives the mesh that it gives through COLMAP's text: in the same bytes, or,
// where rotations go through another form or points are floats, nearly so.

#include <filesystem>
#include <string>
#include <vector>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/scene/formats/export_colmap.h"
#include "common/scene/formats/import.h"
#include "tests/end_to_end/program.h"
#include "tests/end_to_end/running_service.h"
#include "tests/scene_formats/scene_writers.h"

namespace meshwright::end_to_end {
namespace {

namespace fs = std::filesystem;

const std::vector<std::string> kQuick = {"--max-image-size", "160", "--quiet"};

const Scene& SmallScene() {
  static const auto* const scene = new Scene(*ImportScene(SharedScene("small")));
  return *scene;
}

// Reconstructed from COLMAP's text, with or without points.
const std::string& Reference(bool with_points) {
  static const auto* const folder = new TemporaryFolder;
  const auto make = [](bool points) {
    Scene scene = SmallScene();
    if (!points) scene.points.clear();
    const std::string path = *folder / (points ? "points" : "axes");
    EXPECT_TRUE(ExportColmapText(scene, path + "/model").ok());
    fs::create_symlink(SharedScene("small") + "/images", path + "/images");
    const RunResult result = RunMeshwright(With({"reconstruct", path, "-o", path + ".ply"}, kQuick));
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return path + ".ply";
  };
  static const auto* const with = new std::string(make(true));
  static const auto* const without = new std::string(make(false));
  return with_points ? *with : *without;
}

class SameMeshTest : public testing::TestWithParam<size_t> {};

TEST_P(SameMeshTest, AsThroughColmapsText) {
  const SceneWriter& writer = SceneWriters()[GetParam()];
  const TemporaryFolder folder;
  const std::string scene = folder / "scene";
  fs::create_directories(scene);
  WriteScene(scene, writer.write(SmallScene()));
  for (const SceneView& view : SmallScene().views) {
    const fs::path picture = fs::path(scene) / PicturePath(writer, view.name);
    fs::create_directories(picture.parent_path());
    fs::create_symlink(SharedScene("small") + "/images/" + view.name, picture);
  }
  std::vector<std::string> arguments = With({"reconstruct", scene, "-o", folder / "mesh.ply"}, kQuick);
  if (!writer.has_intrinsics) {
    const Lens& lens = SmallScene().views[0].lens;
    arguments.push_back("--intrinsics");
    arguments.push_back(absl::StrFormat("%.17g,%.17g,%.17g,%.17g", lens.fx, lens.fy, lens.cx, lens.cy));
  }
  const RunResult result = RunMeshwright(arguments);
  ASSERT_EQ(result.exit_code, 0) << writer.format << " " << writer.variant << ": " << result.err;
  const std::string& reference = Reference(writer.has_points);
  if (ReadBytes(folder / "mesh.ply") == ReadBytes(reference)) return;
  const RunResult measured = RunMeshwright({"evaluate", folder / "mesh.ply", reference, "--scene", SharedScene("small"),
                                            "--max-image-size", "160", "--json"});
  ASSERT_EQ(measured.exit_code, 0) << measured.err;
  const double score = JsonOf(measured)["f_score"]["1"].get<double>();
  RecordProperty("f_at_1", absl::StrCat(score));
  EXPECT_GE(score, writer.point_digits > 1e-9 ? 0.99 : 0.999) << writer.format << " " << writer.variant;
}

INSTANTIATE_TEST_SUITE_P(All, SameMeshTest, testing::Range(size_t{0}, SceneWriters().size()));

}  // namespace
}  // namespace meshwright::end_to_end
