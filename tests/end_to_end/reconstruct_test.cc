// SPDX-License-Identifier: Apache-2.0
// The whole program on synthetic scenes: is the mesh right, and is it always the same?

#include <algorithm>
#include <filesystem>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/end_to_end/program.h"

namespace meshwright::end_to_end {
namespace {

namespace fs = std::filesystem;

std::string Reconstruct(const std::string& scene, const std::string& output,
                        const std::vector<std::string>& options = {}) {
  std::vector<std::string> arguments = {"reconstruct", scene, "-o", output, "--quiet"};
  arguments.insert(arguments.end(), options.begin(), options.end());
  const RunResult result = RunMeshwright(arguments);
  EXPECT_EQ(result.exit_code, 0) << result.err;
  return ReadBytes(output);
}

// The mesh of the small scene, made once.
const std::string& ReferenceMesh() {
  static const std::string bytes = [] {
    const TemporaryFolder folder;
    return Reconstruct(SharedScene("small"), folder / "mesh.ply");
  }();
  return bytes;
}

double FScoreAt2(const std::string& scene, const std::string& mesh) {
  const RunResult result = RunMeshwright({"evaluate", mesh, scene + "/ground_truth.ply", "--scene", scene, "--json"});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json report = JsonOf(result);
  return report.is_object() ? report["f_score"]["2"].get<double>() : 0;
}

TEST(ReconstructTest, TheFacadeIsReconstructed) {
  const TemporaryFolder folder;
  Reconstruct(SharedScene("facade"), folder / "mesh.ply");
  EXPECT_GE(FScoreAt2(SharedScene("facade"), folder / "mesh.ply"), 0.90);
}

TEST(ReconstructTest, TheRingIsReconstructed) {
  const TemporaryFolder folder;
  Reconstruct(SharedScene("ring"), folder / "mesh.ply");
  EXPECT_GE(FScoreAt2(SharedScene("ring"), folder / "mesh.ply"), 0.90);
}

TEST(ReconstructTest, SameBytesWithAnyNumberOfThreadsAndLittleMemory) {
  const TemporaryFolder folder;
  EXPECT_TRUE(Reconstruct(SharedScene("small"), folder / "one.ply", {"--threads", "1"}) == ReferenceMesh());
  EXPECT_TRUE(Reconstruct(SharedScene("small"), folder / "five.ply", {"--threads", "5"}) == ReferenceMesh());
  EXPECT_TRUE(Reconstruct(SharedScene("small"), folder / "low.ply", {"--memory", "64"}) == ReferenceMesh());
}

TEST(ReconstructTest, SameBytesWhenKilledAndResumed) {
  const TemporaryFolder folder;
  const std::string output = folder / "mesh.ply";
  const std::vector<std::string> arguments = {"reconstruct", SharedScene("small"), "-o", output, "--quiet"};
  const double whole_run =
      RunMeshwright({"reconstruct", SharedScene("small"), "-o", folder / "timed.ply", "--quiet"}).seconds;
  std::mt19937 random(20090929);
  std::uniform_real_distribution<double> share(0.05, 0.4);  // the measured run may have been slowed by others
  int kills = 0;
  RunResult result;
  for (int i = 0; i < 8; ++i) {
    result = RunMeshwright(arguments, {.kill_after_seconds = share(random) * whole_run});
    if (result.signal == 0) break;
    ++kills;
    EXPECT_FALSE(fs::exists(output)) << "a mesh may only be there when all of it is";
  }
  if (result.signal != 0) result = RunMeshwright(arguments);
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_GE(kills, 1);
  EXPECT_TRUE(ReadBytes(output) == ReferenceMesh());
  EXPECT_THAT(ListFolder(folder.path()),
              testing::ElementsAre("mesh.ply", "mesh.report.json", "timed.ply", "timed.report.json"));
}

// COLMAP's images.txt has two lines for each image.
std::string WithImagesReversed(const std::string& images_txt) {
  std::istringstream stream(images_txt);
  std::vector<std::string> comments, images;
  std::string line;
  while (std::getline(stream, line)) {
    if (!line.empty() && line[0] == '#') {
      comments.push_back(line + "\n");
      continue;
    }
    std::string second;
    std::getline(stream, second);
    images.push_back(line.append("\n").append(second).append("\n"));
  }
  std::reverse(images.begin(), images.end());
  std::string text;
  for (const std::string& part : comments) text += part;
  for (const std::string& part : images) text += part;
  return text;
}

TEST(ReconstructTest, SameBytesWhateverTheOrderOfImagesInTheFile) {
  const TemporaryFolder folder;
  const std::string scene = folder / "scene";
  fs::copy(SharedScene("small"), scene, fs::copy_options::recursive);
  const std::string listed = ReadBytes(scene + "/model/images.txt");
  const std::string reversed = WithImagesReversed(listed);
  ASSERT_NE(listed, reversed);
  WriteBytes(scene + "/model/images.txt", reversed);
  EXPECT_TRUE(Reconstruct(scene, folder / "mesh.ply") == ReferenceMesh());
}

// `scene` with its last photograph called 0007 and a byte that is no text.
std::string WithANameThatIsNoText(const std::string& scene, const std::string& copy) {
  fs::copy(scene, copy, fs::copy_options::recursive);
  const std::string name = "0007\xE9.png";
  fs::rename(copy + "/images/0007.png", copy + "/images/" + name);
  std::string images = ReadBytes(copy + "/model/images.txt");
  images.replace(images.find("0007.png"), 8, name);
  WriteBytes(copy + "/model/images.txt", images);
  return copy;
}

TEST(ReconstructTest, NamesThatAreNoTextChangeNothing) {
  const TemporaryFolder folder;
  const std::string scene = WithANameThatIsNoText(SharedScene("small"), folder / "sc\xE8ne");
  const std::vector<std::string> quick = {"--max-image-size", "160"};
  EXPECT_TRUE(Reconstruct(scene, folder / "m\xE9sh.ply", quick) ==
              Reconstruct(SharedScene("small"), folder / "mesh.ply", quick));
  const nlohmann::json report = nlohmann::json::parse(ReadBytes(folder / "m\xE9sh.report.json"), nullptr, false);
  ASSERT_TRUE(report.is_object());
  std::vector<std::string> names;
  for (const auto& camera : report["cameras"]) names.push_back(camera["name"]);
  EXPECT_THAT(names, testing::Contains("0007%E9.png"));
  // Uploads have no way to say such a name.
  const RunResult submitted = RunMeshwright({"submit", scene, "--coordinator", "127.0.0.1:1"});
  EXPECT_EQ(submitted.exit_code, 3);
  EXPECT_THAT(submitted.err, testing::HasSubstr("images/0007%E9.png"));
}

TEST(ReconstructTest, TheReportSaysWhatWasDone) {
  const TemporaryFolder folder;
  const RunResult result = RunMeshwright(
      {"reconstruct", SharedScene("small"), "-o", folder / "mesh.ply", "--json", "--parts", "--window", "2"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json printed = JsonOf(result);
  ASSERT_TRUE(printed.is_object()) << result.out;
  EXPECT_EQ(printed["report"], folder / "mesh.report.json");
  EXPECT_EQ(printed["options"]["window"], 2);

  const nlohmann::json report = nlohmann::json::parse(ReadBytes(folder / "mesh.report.json"), nullptr, false);
  ASSERT_TRUE(report.is_object());
  ASSERT_EQ(report["cameras"].size(), 8);
  int64_t rays_accepted = 0;
  int cameras_with_surface = 0;
  for (size_t i = 0; i < 8; ++i) {
    const nlohmann::json& camera = report["cameras"][i];
    EXPECT_EQ(camera["sequence"], i + 1);
    EXPECT_GE(camera["neighbours"], camera["targets"].size());
    EXPECT_GE(camera["rays"], camera["rays_grown"]);
    EXPECT_GE(camera["rays_grown"], camera["rays_filtered"]);
    EXPECT_GE(camera["rays_filtered"], camera["rays_accepted"]);
    EXPECT_LE(camera["mrf_lower_bound"].get<double>(), camera["mrf_energy"].get<double>());
    EXPECT_TRUE(camera["seconds"]["growing"].is_number());
    rays_accepted += camera["rays_accepted"].get<int64_t>();
    cameras_with_surface += camera["rays_accepted"] > 0 ? 1 : 0;
  }
  EXPECT_EQ(report["totals"]["rays_accepted"], rays_accepted);
  EXPECT_GT(report["process"]["peak_memory_bytes"], 0);
  // A part for each camera's surface, and one more for what was accepted only once all cameras were there.
  const std::vector<std::string> parts = ListFolder(folder / "mesh.parts");
  const auto late = std::count_if(parts.begin(), parts.end(),
                                  [](const std::string& name) { return name.find("_late.ply") != std::string::npos; });
  EXPECT_EQ(static_cast<int>(parts.size()) - late, cameras_with_surface);
  EXPECT_LE(late, 8);
  EXPECT_THAT(ListFolder(folder.path()), testing::ElementsAre("mesh.parts", "mesh.ply", "mesh.report.json"));
}

TEST(ReconstructTest, AWorkFolderOfOtherOptionsIsRefusedAndNamed) {
  const TemporaryFolder folder;
  std::vector<std::string> arguments = {"reconstruct", SharedScene("small"), "-o", folder / "mesh.ply",
                                        "--quiet",     "--keep-work-dir"};
  ASSERT_EQ(RunMeshwright(arguments).exit_code, 0);
  ASSERT_TRUE(fs::exists(folder / "mesh.ply.work"));
  // Again: everything is there already.
  const RunResult again = RunMeshwright(arguments);
  EXPECT_EQ(again.exit_code, 0) << again.err;
  EXPECT_TRUE(ReadBytes(folder / "mesh.ply") == ReferenceMesh());

  arguments.emplace_back("--min-quality");
  arguments.emplace_back("0.65");
  const RunResult refused = RunMeshwright(arguments);
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.err, testing::ContainsRegex("--min-quality was 0.[0-9]+, now 0.65"));
  arguments.emplace_back("--restart");
  const RunResult restarted = RunMeshwright(arguments);
  EXPECT_EQ(restarted.exit_code, 0) << restarted.err;
  EXPECT_FALSE(ReadBytes(folder / "mesh.ply") == ReferenceMesh());
}

TEST(ReconstructTest, AFolderOfSomebodyElseIsNotWorkedIn) {
  const TemporaryFolder folder;
  fs::create_directory(folder / "photos");
  WriteBytes(folder / "photos/holiday.jpg", "dear");
  for (const char* option : {"--quiet", "--restart"}) {
    const RunResult result = RunMeshwright(
        {"reconstruct", SharedScene("small"), "-o", folder / "mesh.ply", "--work-dir", folder / "photos", option});
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_THAT(result.err, testing::HasSubstr("not a work folder"));
    EXPECT_THAT(ListFolder(folder / "photos"), testing::ElementsAre("holiday.jpg"));
  }
}

}  // namespace
}  // namespace meshwright::end_to_end
