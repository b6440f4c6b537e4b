// SPDX-License-Identifier: Apache-2.0
// Photographs alone through the service: a worker with COLMAP takes the stage that estimates their cameras, under a
// lease as any job. COLMAP is pipeline/cameras/fake_colmap, whose mapper finds the true cameras.

#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/end_to_end/program.h"
#include "tests/end_to_end/running_service.h"

namespace meshwright::end_to_end {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

const std::vector<std::string> kQuickOptions = {"--max-image-size", "240"};

template <typename T>
void Put(std::string& bytes, T value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof(value));
}

std::vector<std::vector<std::string>> Rows(const std::string& path) {
  std::vector<std::vector<std::string>> rows;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    if (!line.empty() && line.front() == '#') continue;
    std::istringstream words(line);
    rows.emplace_back(std::istream_iterator<std::string>(words), std::istream_iterator<std::string>());
  }
  return rows;
}

// A model of COLMAP as text (PINHOLE cameras), as the mapper writes it.
void WriteBinaryModel(const std::string& text, const std::string& binary) {
  fs::create_directories(binary);
  const auto number = [](const std::string& word) { return std::strtod(word.c_str(), nullptr); };
  const auto whole = [](const std::string& word) { return std::strtoull(word.c_str(), nullptr, 10); };
  const auto cameras = Rows(text + "/cameras.txt");
  std::string bytes;
  Put(bytes, static_cast<uint64_t>(cameras.size()));
  for (const auto& row : cameras) {
    Put(bytes, static_cast<uint32_t>(whole(row[0])));
    Put(bytes, int32_t{1});
    Put(bytes, uint64_t{whole(row[2])});
    Put(bytes, uint64_t{whole(row[3])});
    for (size_t i = 4; i < row.size(); ++i) Put(bytes, number(row[i]));
  }
  WriteBytes(binary + "/cameras.bin", bytes);

  const auto images = Rows(text + "/images.txt");
  bytes.clear();
  Put(bytes, static_cast<uint64_t>(images.size() / 2));
  for (size_t i = 0; i + 1 < images.size(); i += 2) {
    const auto& row = images[i];
    Put(bytes, static_cast<uint32_t>(whole(row[0])));
    for (size_t k = 1; k < 8; ++k) Put(bytes, number(row[k]));
    Put(bytes, static_cast<uint32_t>(whole(row[8])));
    bytes += row[9] + '\0';
    const auto& points = images[i + 1];
    Put(bytes, static_cast<uint64_t>(points.size() / 3));
    for (size_t k = 0; k + 2 < points.size(); k += 3) {
      Put(bytes, number(points[k]));
      Put(bytes, number(points[k + 1]));
      Put(bytes, static_cast<int64_t>(std::strtoll(points[k + 2].c_str(), nullptr, 10)));
    }
  }
  WriteBytes(binary + "/images.bin", bytes);

  const auto points = Rows(text + "/points3D.txt");
  bytes.clear();
  Put(bytes, static_cast<uint64_t>(points.size()));
  for (const auto& row : points) {
    Put(bytes, uint64_t{whole(row[0])});
    for (size_t k = 1; k < 4; ++k) Put(bytes, number(row[k]));
    for (size_t k = 4; k < 7; ++k) Put(bytes, static_cast<uint8_t>(whole(row[k])));
    Put(bytes, number(row[7]));
    Put(bytes, static_cast<uint64_t>((row.size() - 8) / 2));
    for (size_t k = 8; k < row.size(); ++k) Put(bytes, static_cast<uint32_t>(whole(row[k])));
  }
  WriteBytes(binary + "/points3D.bin", bytes);
}

class PhotographsTest : public testing::Test {
 protected:
  PhotographsTest() {
    scene_ = SharedScene("small");
    photographs_ = service_.folder() / "photographs";
    fs::copy(scene_ + "/images", photographs_);
    mode_ = service_.folder() / "mode";
    Mode("");
    WriteBinaryModel(scene_ + "/model", mode_ + ".model0");
    fs::create_directories(service_.folder() / "bin");
    fs::create_symlink(MW_FAKE_COLMAP, service_.folder() / "bin/colmap");
    ::setenv("FAKE_COLMAP_MODE", mode_.c_str(), 1);
    ::setenv("TMPDIR", service_.folder().path().c_str(), 1);
  }
  ~PhotographsTest() override {
    ::setenv("PATH", path_.c_str(), 1);
    ::unsetenv("TMPDIR");
  }

  void Mode(const std::string& lines) const { WriteBytes(mode_, lines); }
  std::string Calls() const { return fs::exists(mode_ + ".calls") ? ReadBytes(mode_ + ".calls") : ""; }
  int Count(const std::string& step) const {
    int count = 0;
    std::istringstream lines(Calls());
    for (std::string line; std::getline(lines, line);) count += line.rfind(step + " ", 0) == 0 ? 1 : 0;
    return count;
  }

  std::unique_ptr<BackgroundProgram> StartWorker(const std::string& id, bool has_colmap) {
    ::setenv("PATH", has_colmap ? (service_.folder() / "bin:" + path_).c_str() : "/nonexistent", 1);
    auto worker = service_.StartWorker(id);
    ::setenv("PATH", path_.c_str(), 1);
    return worker;
  }
  std::string Stage() const { return service_.Status("p").value("stage", ""); }

  const std::string path_ = std::getenv("PATH");
  RunningService service_;
  std::string scene_;
  std::string photographs_;
  std::string mode_;
};

TEST_F(PhotographsTest, AWorkerKilledInEachStepIsFollowedByOneThatGoesOn) {
  const auto coordinator = service_.StartCoordinator();
  const auto plain = StartWorker("plain", false);
  const RunResult submitted = service_.Client(With({"submit", photographs_, "--id", "p"}, kQuickOptions));
  ASSERT_EQ(submitted.exit_code, 0) << submitted.err;
  EXPECT_TRUE(WaitUntil([&] { return Stage() == "cameras: waiting for a worker with COLMAP"; }, 30)) << Stage();
  for (const char* step : {"feature_extractor", "matches_importer", "mapper"}) {
    Mode(std::string(step) + " hang\n");
    const auto worker = StartWorker("colmap", true);
    ASSERT_TRUE(WaitUntil([&] { return Count(step) == 1; }, 60)) << step << "\n" << Stage();
    worker->Stop(SIGKILL);
  }
  Mode("");
  const auto worker = StartWorker("colmap", true);
  EXPECT_TRUE(service_.WaitForMesh("p") == service_.LocalMesh(scene_, kQuickOptions));
  for (const char* step : {"feature_extractor", "matches_importer", "mapper"}) EXPECT_EQ(Count(step), 2) << step;
  EXPECT_EQ(Count("database_creator"), 1);
  // Nothing is left at the worker.
  for (const auto& entry : fs::recursive_directory_iterator(service_.folder().path())) {
    EXPECT_THAT(entry.path().filename().string(), testing::Not(testing::StartsWith("cameras-")));
  }
}

TEST_F(PhotographsTest, PhotographsThatGiveNoCamerasFailOnceWithAdvice) {
  const auto coordinator = service_.StartCoordinator();
  Mode("mapper no_initial_pair\n");
  const auto worker = StartWorker("colmap", true);
  ASSERT_EQ(service_.Client(With({"submit", photographs_, "--id", "p"}, kQuickOptions)).exit_code, 0);
  EXPECT_TRUE(WaitUntil([&] { return service_.Status("p")["state"] == "failed"; }, 60));
  EXPECT_THAT(service_.Status("p").value("failure", ""), HasSubstr("every 5 to 15 degrees"));
  EXPECT_EQ(Count("mapper"), 2);  // the second with less strict limits
}

}  // namespace
}  // namespace meshwright::end_to_end
