// SPDX-License-Identifier: Apache-2.0
#include "pipeline/local/local_reconstruction.h"

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <mutex>

#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>

#include "common/base/bad_input.h"
#include "common/base/check.h"
#include "common/base/files.h"
#include "common/base/method_version.h"
#include "common/image/encode.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

constexpr int kCameras = 12;
constexpr double kWallDepth = 10;

// Cameras side by side in front of a wall; photographs are there but nobody looks at them: the job is a quick one.
class LocalReconstructionTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = testing::TempDir() + "local_XXXXXX";
    MW_CHECK(mkdtemp(pattern.data()) != nullptr);
    folder_ = pattern;
    for (int i = 0; i < kCameras; ++i) {
      SceneView view;
      view.name = std::string("v") + static_cast<char>('a' + i);
      view.image_path = folder_ + "/" + view.name + ".png";
      view.lens = {.width = 64, .height = 48, .fx = 100, .fy = 100, .cx = 32, .cy = 24};
      view.cam_from_world.translation = {-static_cast<double>(i), 0, 0};
      MW_CHECK(WritePng(view.image_path, {64, 48, std::vector<uint8_t>(3 * 64 * 48, static_cast<uint8_t>(i))}).ok());
      scene_.views.push_back(view);
    }
    for (double x = -3; x < kCameras + 2; x += 0.25) {
      for (double y = -2; y <= 2; y += 0.5) {
        SparsePoint point;
        point.x_in_world = {x, y, kWallDepth};
        for (CameraIndex i = 0; i < kCameras; ++i) {
          if (std::abs(x - i) < 3.1) point.seen_by.push_back(i);
        }
        if (point.seen_by.size() >= 2) scene_.points.push_back(point);
      }
    }
  }
  void TearDown() override { fs::remove_all(folder_); }

  LocalSettings Settings(const std::string& name, int threads) const {
    return {.output_path = folder_ + "/" + name + ".ply",
            .report_path = folder_ + "/" + name + ".report.json",
            .work_folder = folder_ + "/" + name + ".work",
            .threads = threads};
  }

  // The wall wherever nothing was accepted yet.
  CameraJobResult QuickJob(const CameraJobInput& input) {
    const int now = ++running_;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      most_running_ = std::max(most_running_, now);
    }
    CameraJobResult result;
    result.filtered =
        PatchLattice::Empty(input.reference.camera_index, input.reference.camera, options_.job.lattice_step);
    PatchLattice& surface = result.filtered;
    result.report.rays = surface.lattice.nodes();
    for (size_t node = 0; node < surface.depth.size(); ++node) {
      if (input.accepted.depth[node] > 0) {
        ++result.report.rays_covered_before;
        continue;
      }
      surface.depth[node] = static_cast<float>(kWallDepth);
      surface.normal_in_world[node] = {0, 0, -1};
      surface.rgb[node] = {static_cast<uint8_t>(input.targets.size()), static_cast<uint8_t>(node & 0xFFU), 0};
      const auto column = static_cast<int>(node) % surface.lattice.columns;
      const auto row = static_cast<int>(node) / surface.lattice.columns;
      if (column + 1 < surface.lattice.columns && !(input.accepted.depth[node + 1] > 0)) {
        surface.links[node] |= PatchLattice::kLinkRight;
      }
      const size_t below = node + static_cast<size_t>(surface.lattice.columns);
      if (row + 1 < surface.lattice.rows && !(input.accepted.depth[below] > 0)) {
        surface.links[node] |= PatchLattice::kLinkDown;
      }
      ++result.report.rays_grown;
    }
    ++jobs_;
    --running_;
    return result;
  }

  absl::StatusOr<nlohmann::ordered_json> Run(const LocalSettings& settings) {
    return ReconstructLocally(
        scene_, options_, settings, [this](const CameraJobInput& input, ThreadPool&) { return QuickJob(input); },
        [this](const LocalProgress& progress) { last_progress_ = progress; });
  }

  // Ends with an error when so many jobs have run.
  absl::StatusOr<nlohmann::ordered_json> RunUntil(int jobs, const LocalSettings& settings) {
    jobs_ = 0;
    const std::string path = scene_.views[6].image_path;
    LocalSettings without_cache = settings;
    without_cache.memory_limit_bytes = 1;  // nothing decoded is kept
    auto broken = ReconstructLocally(
        scene_, options_, without_cache,
        [&](const CameraJobInput& input, ThreadPool&) {
          if (jobs_ == jobs) fs::rename(path, path + ".away");
          return QuickJob(input);
        },
        [](const LocalProgress&) {});
    fs::rename(path + ".away", path);
    return broken;
  }

  static void RunSql(const std::string& path, const std::string& sql) {
    sqlite3* database = nullptr;
    ASSERT_EQ(sqlite3_open(path.c_str(), &database), SQLITE_OK);
    ASSERT_EQ(sqlite3_exec(database, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK) << sqlite3_errmsg(database);
    sqlite3_close(database);
  }

  std::string folder_;
  Scene scene_;
  ReconstructionOptions options_;
  LocalProgress last_progress_;
  std::atomic<int> jobs_{0};
  std::atomic<int> running_{0};
  std::mutex mutex_;
  int most_running_ = 0;
};

TEST_F(LocalReconstructionTest, SameBytesWithAnyNumberOfThreads) {
  const auto one = Run(Settings("one", 1));
  ASSERT_TRUE(one.ok()) << one.status();
  EXPECT_EQ(most_running_, 1);
  EXPECT_EQ(jobs_, kCameras);
  EXPECT_EQ((*one)["totals"]["cameras_processed"], kCameras);
  EXPECT_EQ(last_progress_.stage, LocalStage::kJoining);
  for (const int threads : {2, 8}) {
    const auto more = Run(Settings("more", threads));
    ASSERT_TRUE(more.ok()) << more.status();
    EXPECT_LE(most_running_, options_.conductor.window);
    EXPECT_TRUE(*ReadFile(folder_ + "/one.ply") == *ReadFile(folder_ + "/more.ply"));
    EXPECT_EQ((*one)["totals"], (*more)["totals"]);
  }
  EXPECT_FALSE(fs::exists(folder_ + "/one.work"));
}

TEST_F(LocalReconstructionTest, WithLittleMemoryOneJobRunsAtATime) {
  LocalSettings settings = Settings("low", 4);
  settings.memory_limit_bytes = 1;
  ASSERT_TRUE(Run(settings).ok());
  EXPECT_EQ(most_running_, 1);
}

TEST_F(LocalReconstructionTest, GoesOnAfterAPhotographWasGoneForAWhile) {
  ASSERT_TRUE(Run(Settings("whole", 2)).ok());
  const int jobs_of_a_whole_run = jobs_;

  // Gone after the check at the beginning, before the jobs need it.
  const std::string path = scene_.views[6].image_path;
  const auto broken = RunUntil(3, Settings("broken", 2));
  ASSERT_FALSE(broken.ok());
  EXPECT_TRUE(IsBadInput(broken.status()));
  EXPECT_THAT(std::string(broken.status().message()), testing::HasSubstr(path));
  EXPECT_FALSE(fs::exists(folder_ + "/broken.ply"));

  const auto resumed = Run(Settings("broken", 2));
  ASSERT_TRUE(resumed.ok()) << resumed.status();
  EXPECT_GT((*resumed)["process"]["cameras_done_before"], 0);
  EXPECT_TRUE(*ReadFile(folder_ + "/whole.ply") == *ReadFile(folder_ + "/broken.ply"));
  EXPECT_LT(jobs_, 2 * jobs_of_a_whole_run);
}

// Work folders of 0.1.0: nothing is leased in them, nobody conducts, and no job says what it needs. They are of the
// method's first version, so they are refused; one of today's in that state goes on.
TEST_F(LocalReconstructionTest, GoesOnInAWorkFolderWithoutLeasesIfTheMethodIsTheSame) {
  ASSERT_TRUE(Run(Settings("whole", 1)).ok());
  const std::string as_before =
      "DELETE FROM conductor_leases; PRAGMA user_version = 4;"
      "ALTER TABLE reconstructions DROP COLUMN method_version; ALTER TABLE workers DROP COLUMN method_version;"
      "ALTER TABLE workers DROP COLUMN colmap_version; ALTER TABLE workers DROP COLUMN owner;"
      "ALTER TABLE reconstructions DROP COLUMN joined_thousandths;"
      "ALTER TABLE reconstructions DROP COLUMN expected_end_at;"
      "ALTER TABLE reconstructions DROP COLUMN verdict_json;"
      "UPDATE camera_jobs SET epoch = 1, lease_worker = NULL, lease_expires_at = NULL, lease_instance = NULL,"
      "  leased_at = NULL, memory_bytes = 0, last_ending = 'lost', last_ended_at = 5 WHERE state = 'assigned';";
  ASSERT_FALSE(RunUntil(4, Settings("half", 1)).ok());
  RunSql(folder_ + "/half.work/state.sqlite", as_before);
  const auto other_method = Run(Settings("half", 2));
  ASSERT_TRUE(absl::IsFailedPrecondition(other_method.status())) << other_method.status();
  EXPECT_THAT(std::string(other_method.status().message()), testing::HasSubstr("begun with version 1 of the method"));
  const std::string of_this_method = absl::StrCat("UPDATE reconstructions SET method_version = ", kMethodVersion);
  RunSql(folder_ + "/half.work/state.sqlite", of_this_method);
  const auto half = Run(Settings("half", 2));
  ASSERT_TRUE(half.ok()) << half.status();
  EXPECT_GT((*half)["process"]["cameras_done_before"], 0);
  EXPECT_TRUE(*ReadFile(folder_ + "/whole.ply") == *ReadFile(folder_ + "/half.ply"));

  // Its cameras were done, and its mesh was not there yet.
  LocalSettings settings = Settings("done", 1);
  settings.keep_work_folder = true;
  ASSERT_TRUE(Run(settings).ok());
  RunSql(folder_ + "/done.work/state.sqlite",
         as_before + "UPDATE reconstructions SET state = 'done', finished_at = 5;");
  fs::remove(folder_ + "/done.ply");
  jobs_ = 0;
  ASSERT_FALSE(Run(settings).ok());
  RunSql(folder_ + "/done.work/state.sqlite", of_this_method);
  const auto done = Run(settings);
  ASSERT_TRUE(done.ok()) << done.status();
  EXPECT_EQ(jobs_, 0);
  EXPECT_TRUE(*ReadFile(folder_ + "/whole.ply") == *ReadFile(folder_ + "/done.ply"));

  // One whose jobs are not described in the store cannot go on, and says so.
  ASSERT_FALSE(RunUntil(4, Settings("old", 1)).ok());
  RunSql(folder_ + "/old.work/state.sqlite", as_before + "UPDATE camera_jobs SET spec = '' WHERE state = 'assigned';");
  ASSERT_FALSE(Run(Settings("old", 1)).ok());
  RunSql(folder_ + "/old.work/state.sqlite", of_this_method);
  const auto old = Run(Settings("old", 1));
  EXPECT_TRUE(absl::IsDataLoss(old.status())) << old.status();
  EXPECT_THAT(std::string(old.status().message()), testing::HasSubstr("specification"));
}

TEST_F(LocalReconstructionTest, LostSurfacesAreMadeAgain) {
  ASSERT_TRUE(Run(Settings("whole", 1)).ok());
  LocalSettings settings = Settings("mesh", 2);
  settings.keep_work_folder = true;
  ASSERT_TRUE(Run(settings).ok());
  fs::remove_all(settings.work_folder + "/blobs");
  fs::remove(settings.output_path);
  const auto again = Run(settings);
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_TRUE(*ReadFile(folder_ + "/whole.ply") == *ReadFile(settings.output_path));

  // Half way, what accepted surfaces hide has to be there for the jobs too.
  ASSERT_FALSE(RunUntil(6, Settings("half", 2)).ok());
  fs::remove_all(folder_ + "/half.work/blobs");
  const auto half = Run(Settings("half", 2));
  ASSERT_TRUE(half.ok()) << half.status();
  EXPECT_TRUE(*ReadFile(folder_ + "/whole.ply") == *ReadFile(folder_ + "/half.ply"));
}

TEST_F(LocalReconstructionTest, NothingReconstructedIsAFailureThatSaysWhy) {
  const auto nothing = ReconstructLocally(
      scene_, options_, Settings("nothing", 1),
      [&](const CameraJobInput& input, ThreadPool&) {
        CameraJobResult result;
        result.filtered =
            PatchLattice::Empty(input.reference.camera_index, input.reference.camera, options_.job.lattice_step);
        return result;
      },
      [](const LocalProgress&) {});
  ASSERT_FALSE(nothing.ok());
  EXPECT_THAT(std::string(nothing.status().message()), testing::HasSubstr("nothing was reconstructed"));
  EXPECT_FALSE(fs::exists(folder_ + "/nothing.ply"));
}

TEST_F(LocalReconstructionTest, AChangedPhotographIsAnotherScene) {
  LocalSettings settings = Settings("mesh", 1);
  settings.keep_work_folder = true;
  ASSERT_TRUE(Run(settings).ok());
  ASSERT_TRUE(WritePng(scene_.views[0].image_path, {64, 48, std::vector<uint8_t>(3 * 64 * 48, 99)}).ok());
  const auto refused = Run(settings);
  EXPECT_TRUE(absl::IsFailedPrecondition(refused.status())) << refused.status();
  EXPECT_THAT(std::string(refused.status().message()), testing::HasSubstr("the scene"));
}

}  // namespace
}  // namespace meshwright
