// SPDX-License-Identifier: Apache-2.0
#include "pipeline/cameras/estimate_cameras.h"

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "pipeline/cameras/photographs_testing.h"

#include "common/base/bad_input.h"
#include "common/base/files.h"
#include "common/scene/formats/import.h"

namespace meshwright {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

template <typename T>
std::string Raw(T value) {
  return std::string(reinterpret_cast<const char*>(&value), sizeof(value));
}

// Photographs, and a fake COLMAP (fake_colmap) that does with them what the test says.
class EstimateCamerasTest : public testing::Test {
 protected:
  EstimateCamerasTest() {
    for (const char* name : {"a 1.jpg", "a 2.jpg", "a 10.jpg", "b.jpg"})
      folder_.Write(std::string("p/") + name, TestJpeg());
    ::setenv("FAKE_COLMAP_MODE", (folder_ / "mode").c_str(), 1);
    ::unsetenv("FAKE_COLMAP_VERSION");
    Mode("");
    settings_ = {
        .photographs = folder_ / "p", .scene_folder = folder_ / "scene", .program = MW_FAKE_COLMAP, .threads = 4};
    settings_.say = [this](const std::string& line) { said_.push_back(line); };
    Model(0, {"a 1.jpg", "a 2.jpg", "a 10.jpg"});
  }

  void Mode(const std::string& lines) { folder_.Write("mode", lines); }

  // The model that the mapper will find.
  void Model(int number, const std::vector<std::string>& names) {
    std::string cameras = Raw(uint64_t{1}) + Raw(1) + Raw(0) + Raw(uint64_t{64}) + Raw(uint64_t{48});
    for (const double parameter : {70.0, 32.0, 24.0}) cameras += Raw(parameter);
    std::string images = Raw(static_cast<uint64_t>(names.size()));
    uint32_t id = 0;
    for (const std::string& name : names) {
      images += Raw(++id);
      for (const double value : {1.0, 0.0, 0.0, 0.0, static_cast<double>(id), 0.0, 0.0}) images += Raw(value);
      images += Raw(uint32_t{1}) + name + '\0' + Raw(uint64_t{0});
    }
    const std::string model = absl::StrCat("mode.model", number);
    folder_.Write(model + "/cameras.bin", cameras);
    folder_.Write(model + "/images.bin", images);
    folder_.Write(model + "/points3D.bin", Raw(uint64_t{0}));
  }

  absl::StatusOr<CameraEstimate> Estimate() {
    return EstimateCameras(settings_, clock_,
                           [this](const CameraProgress& progress) { progress_.push_back(progress); });
  }

  // Which of COLMAP's commands ran.
  std::vector<std::string> Calls() {
    std::vector<std::string> steps;
    const absl::StatusOr<std::string> text = ReadFile(folder_ / "mode.calls");
    for (const auto line : absl::StrSplit(text.value_or(""), '\n', absl::SkipEmpty())) {
      steps.emplace_back(line.substr(0, line.find(' ')));
    }
    std::filesystem::remove(folder_ / "mode.calls");
    return steps;
  }

  TemporaryFolder folder_;
  RealClock clock_;
  CameraEstimationSettings settings_;
  std::vector<CameraProgress> progress_;
  std::vector<std::string> said_;
};

TEST_F(EstimateCamerasTest, PhotographsBecomeAScene) {
  const auto estimate = Estimate();
  ASSERT_TRUE(estimate.ok()) << estimate.status();
  EXPECT_EQ(estimate->photographs, 4);
  EXPECT_EQ(estimate->registered, 3);
  EXPECT_THAT(estimate->notes, ElementsAre(HasSubstr("b.jpg")));
  EXPECT_THAT(Calls(), ElementsAre("database_creator", "feature_extractor", "matches_importer", "mapper"));
  const auto scene = ImportScene(folder_ / "scene");
  ASSERT_TRUE(scene.ok()) << scene.status();
  EXPECT_EQ(scene->views.size(), 3U);
  // The same again has nothing to do.
  ASSERT_TRUE(Estimate().ok());
  EXPECT_THAT(Calls(), IsEmpty());
}

TEST_F(EstimateCamerasTest, ProgressNeverFallsAndReachesItsEnd) {
  ASSERT_TRUE(Estimate().ok());
  EXPECT_TRUE(std::is_sorted(progress_.begin(), progress_.end(),
                             [](const CameraProgress& a, const CameraProgress& b) { return a.fraction < b.fraction; }));
  EXPECT_EQ(progress_.back().step, CameraStep::kMapping);
  EXPECT_LE(progress_.back().fraction, 1);
}

TEST_F(EstimateCamerasTest, WhatAStepHasDoneIsKept) {
  const std::vector<std::string> steps = {"feature_extractor", "matches_importer", "mapper"};
  for (size_t i = 0; i < steps.size(); ++i) {
    settings_.scene_folder = folder_ / absl::StrCat("scene", i);
    Mode(steps[i] + " abort\n");
    const auto failed = Estimate();
    EXPECT_TRUE(absl::IsInternal(failed.status())) << failed.status();
    EXPECT_THAT(std::string(failed.status().message()),
                AllOf(HasSubstr(steps[i]), HasSubstr("signal 6"), HasSubstr("Check failed"), HasSubstr("log.txt")));
    Calls();
    Mode("");
    ASSERT_TRUE(Estimate().ok());
    EXPECT_EQ(Calls(), std::vector<std::string>(steps.begin() + static_cast<std::ptrdiff_t>(i), steps.end()));
  }
}

TEST_F(EstimateCamerasTest, FailuresSayWhatToPhotographBetter) {
  const struct {
    const char* mode;
    const char* says;
  } kCases[] = {{"feature_extractor none", "next to no features"},
                {"feature_extractor alone", "no two of the 4 photographs show the same surface"},
                {"matches_importer none", "no two of the 4 photographs show the same surface"},
                {"mapper no_initial_pair", "far enough apart"}};
  for (const auto& failure : kCases) {
    settings_.restart = true;
    settings_.scene_folder = folder_ / failure.mode;
    Mode(absl::StrCat(failure.mode, "\n"));
    const absl::Status status = Estimate().status();
    EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
    EXPECT_THAT(std::string(status.message()), AllOf(HasSubstr(failure.says), HasSubstr("every 5 to 15 degrees")));
    EXPECT_THAT(std::string(status.message()), Not(HasSubstr("\n")));
  }
}

TEST_F(EstimateCamerasTest, WithoutAnInitialPairItTriesOnceMore) {
  Mode("mapper strict\n");
  ASSERT_TRUE(Estimate().ok());
  const std::vector<std::string> calls = Calls();
  EXPECT_EQ(std::count(calls.begin(), calls.end(), "mapper"), 2);
}

TEST_F(EstimateCamerasTest, TheLargestOfSeveralModelsIsTakenAndTheOthersNamed) {
  Model(0, {"b.jpg"});
  Model(1, {"a 1.jpg", "a 2.jpg", "a 10.jpg"});
  const auto estimate = Estimate();
  ASSERT_TRUE(estimate.ok()) << estimate.status();
  EXPECT_THAT(estimate->registered_names, ElementsAre("a 1.jpg", "a 10.jpg", "a 2.jpg"));
  EXPECT_THAT(estimate->notes.front(), AllOf(HasSubstr("1 photographs"), HasSubstr("sparse/1")));
}

TEST_F(EstimateCamerasTest, MasksGoToTheExtractor) {
  folder_.Write("p/masks/b.jpg.png", EncodePng(TestPicture(64, 48)));
  ASSERT_TRUE(Estimate().ok());
  EXPECT_THAT(*ReadFile(folder_ / "mode.calls"), HasSubstr("--ImageReader.mask_path"));
}

TEST_F(EstimateCamerasTest, KilledForMemoryItGoesOnWithFewerThreads) {
  Mode("feature_extractor kill_if_many\n");
  ASSERT_TRUE(Estimate().ok());
  const std::vector<std::string> calls = Calls();
  EXPECT_EQ(std::count(calls.begin(), calls.end(), "feature_extractor"), 3);  // with 4, 2, 1
}

TEST_F(EstimateCamerasTest, FloodsOfOutputAreNotKept) {
  Mode("mapper flood\n");
  ASSERT_TRUE(Estimate().ok());
  EXPECT_LT(std::filesystem::file_size(folder_ / "scene/colmap/log.txt"), 80U << 20);
}

TEST_F(EstimateCamerasTest, StopEndsColmapAndWhatItStarted) {
  Mode("mapper deaf\n");
  const std::string grandchild = folder_ / "mode.grandchild";
  settings_.stop = [&] { return std::filesystem::exists(grandchild) && std::filesystem::file_size(grandchild) > 0; };
  EXPECT_TRUE(absl::IsCancelled(Estimate().status()));
  const pid_t pid = std::stoi(*ReadFile(grandchild));
  for (int i = 0; i < 500 && ::kill(pid, 0) == 0; ++i) ::usleep(20'000);
  EXPECT_NE(::kill(pid, 0), 0);
  Mode("");
  settings_.stop = nullptr;
  EXPECT_TRUE(Estimate().ok());
}

TEST_F(EstimateCamerasTest, AFolderOfOtherPhotographsIsNotOverwritten) {
  ASSERT_TRUE(Estimate().ok());
  folder_.Write("p/c.jpg", TestJpeg(64, 40));
  EXPECT_THAT(std::string(Estimate().status().message()), HasSubstr("--restart"));
  settings_.restart = true;
  EXPECT_TRUE(Estimate().ok());
  folder_.Write("theirs/sparse/0/images.txt", "");
  settings_.scene_folder = folder_ / "theirs";
  EXPECT_FALSE(Estimate().ok());
  EXPECT_TRUE(std::filesystem::exists(folder_ / "theirs/sparse/0/images.txt"));
}

TEST_F(EstimateCamerasTest, MissingOrStrangeColmapIsOneLine) {
  settings_.program = "no-such-colmap";
  EXPECT_THAT(std::string(Estimate().status().message()), HasSubstr("apt-get install colmap"));
  settings_.program = "true";
  EXPECT_THAT(std::string(Estimate().status().message()), HasSubstr("does not answer as COLMAP"));
  settings_.program = MW_FAKE_COLMAP;
  ::setenv("FAKE_COLMAP_VERSION", "4.0", 1);
  EXPECT_THAT(std::string(Estimate().status().message()), HasSubstr("expected 3.6 to 3.11"));
}

}  // namespace
}  // namespace meshwright
