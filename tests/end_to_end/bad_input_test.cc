// SPDX-License-Identifier: Apache-2.0
// Whatever is wrong with the input or the machine: one line that names the file, the right exit code, no crash, and no
// half-written output.

#include <algorithm>
#include <filesystem>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mount.h>
#include <unistd.h>

#include "tests/end_to_end/program.h"

namespace meshwright::end_to_end {
namespace {

namespace fs = std::filesystem;

void ExpectOneLine(const RunResult& result, const std::string& named) {
  EXPECT_EQ(result.signal, 0) << result.err;
  EXPECT_THAT(result.err, testing::StartsWith("meshwright: "));
  EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
  EXPECT_THAT(result.err, testing::HasSubstr(named));
  EXPECT_EQ(result.out, "");
}

std::string Replaced(std::string text, const std::string& what, const std::string& with) {
  const size_t at = text.find(what);
  EXPECT_NE(at, std::string::npos) << what;
  return at == std::string::npos ? text : text.replace(at, what.size(), with);
}

std::string Noise(size_t bytes) {
  std::mt19937 random(7);
  std::string noise(bytes, '\0');
  for (char& c : noise) c = static_cast<char>(random() & 0xFFU);
  return noise;
}

struct Damage {
  const char* name;
  const char* named;  // what the message must name
  std::function<void(const std::string& scene)> apply;
};

void PrintTo(const Damage& damage, std::ostream* stream) { *stream << damage.name; }

const std::vector<Damage>& Damages() {
  static const auto* const damages = new std::vector<Damage>{
      {"TruncatedImage", "0003.png",
       [](const std::string& scene) {
         const std::string bytes = ReadBytes(scene + "/images/0003.png");
         WriteBytes(scene + "/images/0003.png", bytes.substr(0, bytes.size() * 2 / 3));
       }},
      {"ImageOfNoise", "0003.png",
       [](const std::string& scene) { WriteBytes(scene + "/images/0003.png", Noise(4000)); }},
      {"EmptyImage", "0003.png", [](const std::string& scene) { WriteBytes(scene + "/images/0003.png", ""); }},
      {"ImageOfAnotherSize", "480",
       [](const std::string& scene) {
         WriteBytes(scene + "/model/cameras.txt",
                    Replaced(ReadBytes(scene + "/model/cameras.txt"), "480 360", "640 360"));
       }},
      {"NanInACamera", "cameras.txt",
       [](const std::string& scene) {
         WriteBytes(scene + "/model/cameras.txt",
                    Replaced(ReadBytes(scene + "/model/cameras.txt"), "480 360 ", "480 360 nan "));
       }},
      {"ZeroCameras", "images.txt",
       [](const std::string& scene) {
         WriteBytes(scene + "/model/images.txt", "# nothing\n");
         WriteBytes(scene + "/model/points3D.txt", "");
       }},
      {"CamerasOfNoise", "cameras.txt",
       [](const std::string& scene) { WriteBytes(scene + "/model/cameras.txt", Noise(3000)); }},
      {"ImagesFileOfNoise", "images.txt",
       [](const std::string& scene) { WriteBytes(scene + "/model/images.txt", Noise(3000)); }},
      {"EmptyFolder", "scene",
       [](const std::string& scene) {
         fs::remove_all(scene);
         fs::create_directory(scene);
       }},
      {"NoFolder", "scene", [](const std::string& scene) { fs::remove_all(scene); }},
  };
  return *damages;
}

class DamagedSceneTest : public testing::TestWithParam<Damage> {};

TEST_P(DamagedSceneTest, IsBadInput) {
  const TemporaryFolder folder;
  const std::string scene = folder / "scene";
  fs::copy(SharedScene("small"), scene, fs::copy_options::recursive);
  GetParam().apply(scene);
  const RunResult result = RunMeshwright({"reconstruct", scene, "-o", folder / "mesh.ply", "--quiet"});
  EXPECT_EQ(result.exit_code, 3) << result.err;
  ExpectOneLine(result, GetParam().named);
  for (const std::string& name : ListFolder(folder.path())) EXPECT_EQ(name, "scene");
}

INSTANTIATE_TEST_SUITE_P(All, DamagedSceneTest, testing::ValuesIn(Damages()),
                         [](const testing::TestParamInfo<Damage>& info) { return info.param.name; });

TEST(BadOutputTest, AFolderThatIsNotThere) {
  const TemporaryFolder folder;
  const std::string output = folder / "nowhere/mesh.ply";
  const RunResult result = RunMeshwright({"reconstruct", SharedScene("small"), "-o", output, "--quiet"});
  EXPECT_EQ(result.exit_code, 1);
  ExpectOneLine(result, output);
  EXPECT_TRUE(ListFolder(folder.path()).empty());
}

TEST(BadOutputTest, AFolderInThePlaceOfTheMesh) {
  const TemporaryFolder folder;
  const std::string output = folder / "folder.ply";
  fs::create_directory(output);
  const RunResult result = RunMeshwright({"reconstruct", SharedScene("small"), "-o", output, "--quiet"});
  EXPECT_EQ(result.exit_code, 1);
  ExpectOneLine(result, output);
}

TEST(BadOutputTest, AResultWithoutAFaceIsAFailure) {
  const TemporaryFolder folder;
  const RunResult result = RunMeshwright(
      {"reconstruct", SharedScene("small"), "-o", folder / "mesh.ply", "--max-image-size", "20", "--quiet"});
  EXPECT_EQ(result.exit_code, 1);
  ExpectOneLine(result, "nothing was reconstructed");
  EXPECT_FALSE(fs::exists(folder / "mesh.ply"));
}

TEST(BadOutputTest, PhotographsAndDevicesAreNotReplaced) {
  const TemporaryFolder folder;
  const std::string scene = folder / "scene";
  fs::copy(SharedScene("small"), scene, fs::copy_options::recursive);
  const std::string photograph = scene + "/images/0003.png";
  const std::string before = ReadBytes(photograph);
  fs::create_symlink(photograph, folder / "link.ply");
  for (const std::string& output : {photograph, scene + "/model/../images/0003.png", folder / "link.ply"}) {
    const RunResult result = RunMeshwright({"reconstruct", scene, "-o", output, "--quiet"});
    EXPECT_NE(result.exit_code, 0) << output;
    EXPECT_TRUE(ReadBytes(photograph) == before) << output;
  }
  fs::create_symlink("/dev/full", folder / "device.ply");
  const RunResult device = RunMeshwright({"reconstruct", scene, "-o", folder / "device.ply", "--quiet"});
  EXPECT_EQ(device.exit_code, 1);
  ExpectOneLine(device, folder / "device.ply");
  EXPECT_TRUE(fs::is_character_file("/dev/full"));
}

TEST(BadOutputTest, ALinkIsWrittenThrough) {
  const TemporaryFolder folder;
  WriteBytes(folder / "target.ply", "before");
  fs::create_symlink("target.ply", folder / "link.ply");
  const RunResult result = RunMeshwright({"reconstruct", SharedScene("small"), "-o", folder / "link.ply", "--quiet"});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_TRUE(fs::is_symlink(folder / "link.ply"));
  EXPECT_EQ(ReadBytes(folder / "target.ply").substr(0, 3), "ply");
}

TEST(BadOutputTest, AFolderThatMayNotBeWritten) {
  if (::geteuid() == 0) GTEST_SKIP() << "root may write everywhere";
  const TemporaryFolder folder;
  fs::permissions(folder.path(), fs::perms::owner_read | fs::perms::owner_exec);
  const RunResult result = RunMeshwright({"reconstruct", SharedScene("small"), "-o", folder / "mesh.ply", "--quiet"});
  fs::permissions(folder.path(), fs::perms::owner_all);
  EXPECT_EQ(result.exit_code, 1);
  ExpectOneLine(result, folder / "mesh.ply");
}

// Files may not grow beyond a limit, as when the disk is full: wherever the first write fails, the same is asked for.
TEST(BadOutputTest, WritesThatFailLeaveNothingHalfWrittenAndCanBeResumed) {
  const TemporaryFolder folder;
  const std::vector<std::string> arguments = {"reconstruct", SharedScene("small"), "-o", folder / "mesh.ply",
                                              "--quiet"};
  for (const int64_t limit : {int64_t{1} << 10, int64_t{40} << 10, int64_t{300} << 10, int64_t{2} << 20}) {
    const RunResult result = RunMeshwright(arguments, {.max_file_bytes = limit});
    EXPECT_EQ(result.exit_code, 1) << limit;
    ExpectOneLine(result, folder / "mesh.ply");
    for (const std::string& name : ListFolder(folder.path())) EXPECT_EQ(name, "mesh.ply.work");
  }
  const RunResult result = RunMeshwright(arguments);
  EXPECT_EQ(result.exit_code, 0) << result.err;
}

TEST(BadOutputTest, AFullDisk) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can make a small disk";
  const TemporaryFolder folder;
  if (::mount("tmpfs", folder.path().c_str(), "tmpfs", 0, "size=3m") != 0) GTEST_SKIP() << "no mounts in here";
  const RunResult result = RunMeshwright({"reconstruct", SharedScene("small"), "-o", folder / "mesh.ply", "--quiet"});
  const std::vector<std::string> left = ListFolder(folder.path());
  ::umount2(folder.path().c_str(), MNT_DETACH);
  EXPECT_EQ(result.exit_code, 1);
  ExpectOneLine(result, folder.path());
  EXPECT_THAT(left, testing::Not(testing::Contains("mesh.ply")));
}

TEST(BadMeshTest, EvaluateNamesTheFile) {
  const TemporaryFolder folder;
  const std::string scene = SharedScene("small");
  WriteBytes(folder / "noise.ply", Noise(5000));
  const RunResult noise =
      RunMeshwright({"evaluate", folder / "noise.ply", scene + "/ground_truth.ply", "--scene", scene});
  EXPECT_EQ(noise.exit_code, 3);
  ExpectOneLine(noise, "noise.ply");
  const RunResult missing =
      RunMeshwright({"evaluate", scene + "/ground_truth.ply", folder / "gone.ply", "--scene", scene});
  EXPECT_EQ(missing.exit_code, 3);
  ExpectOneLine(missing, "gone.ply");
}

}  // namespace
}  // namespace meshwright::end_to_end
