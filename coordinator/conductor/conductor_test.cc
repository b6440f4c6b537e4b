#include "coordinator/conductor/conductor.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <random>

#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/base/check.h"
#include "common/blob/filesystem_blob_store.h"
#include "common/surface/codec.h"
#include "coordinator/store/sqlite_job_store.h"

namespace meshwright {
namespace {

constexpr int kStep = 2;
constexpr double kWallDepth = 10;

// Cameras side by side in front of a wall, one unit apart.
struct Wall {
  std::vector<Camera> cameras;
  std::vector<SparsePoint> points;
};

Wall MakeWall(int count) {
  Wall wall;
  for (int i = 0; i < count; ++i) {
    Camera camera = {.width = 64, .height = 48, .fx = 100, .fy = 100, .cx = 32, .cy = 24};
    camera.cam_from_world.translation = {-static_cast<double>(i), 0, 0};
    wall.cameras.push_back(camera);
  }
  for (double x = -3; x < count + 2; x += 0.25) {
    for (double y = -2; y <= 2; y += 0.5) {
      SparsePoint point;
      point.x_in_world = {x, y, kWallDepth};
      for (CameraIndex i = 0; i < count; ++i) {
        const Camera& camera = wall.cameras[static_cast<size_t>(i)];
        if (camera.Contains(camera.ProjectFromCam(camera.CamFromWorld(point.x_in_world)))) point.seen_by.push_back(i);
      }
      if (point.seen_by.size() >= 2) wall.points.push_back(point);
    }
  }
  return wall;
}

// What a worker would find: the wall, where nothing was accepted yet. Depends on the spec alone.
PatchLattice FakeFilteredSurface(const Wall& wall, const CameraJobSpec& spec) {
  const Camera& camera = wall.cameras[static_cast<size_t>(spec.camera)];
  PatchLattice surface = PatchLattice::Empty(spec.camera, camera, kStep);
  for (int row = 0; row < surface.lattice.rows; ++row) {
    for (int column = 0; column < surface.lattice.columns; ++column) {
      const auto node = static_cast<size_t>(surface.lattice.Index(column, row));
      if ((column + static_cast<int>(spec.accepted.size())) % 7 == 0) continue;
      surface.depth[node] = static_cast<float>(kWallDepth);
      surface.normal_in_world[node] = {0, 0, -1};
      surface.quality[node] = 0.9F;
      surface.rgb[node] = {static_cast<uint8_t>(spec.snapshot), static_cast<uint8_t>(spec.targets.size()), 7};
    }
  }
  return surface;
}

class ConductorTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = testing::TempDir() + "conductor_XXXXXX";
    MW_CHECK(mkdtemp(pattern.data()) != nullptr);
    folder_ = pattern;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  // A fresh store and its blobs.
  void StartAnew(const std::string& name, const ConductorOptions& options) {
    conductor_.reset();
    options_ = options;
    store_path_ = absl::StrCat(folder_, "/", name, ".sqlite");
    blobs_ = *FilesystemBlobStore::Open(absl::StrCat(folder_, "/", name));
    store_ = *OpenSqliteJobStore(store_path_);
    ASSERT_TRUE(store_->CreateReconstruction({"wall", "{}", std::string(64, '0')}, clock_.Now()).ok());
    OpenConductor();
  }

  void OpenConductor() {
    conductor_.reset();
    store_ = *OpenSqliteJobStore(store_path_);
    auto opened =
        Conductor::Open("wall", wall_.cameras, wall_.points, options_, store_.get(), blobs_.get(), &clock_, &pool_);
    ASSERT_TRUE(opened.ok()) << opened.status();
    conductor_ = *std::move(opened);
  }

  std::string PutFiltered(const CameraJobSpec& spec) {
    return *blobs_->Put(EncodeSurface(FakeFilteredSurface(wall_, spec)));
  }

  absl::Status Finish(const CameraJobSpec& spec) {
    return conductor_->Complete(spec.sequence, spec.epoch, PutFiltered(spec), {}, "{}");
  }

  // Runs to the end, finishing jobs in an order drawn from `seed` and dying now and then.
  void RunToTheEnd(unsigned seed, double death_rate) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(0, 1);
    std::vector<CameraJobSpec> held;
    while (!conductor_->finished()) {
      for (CameraJobSpec& spec : conductor_->TakeJobs()) held.push_back(std::move(spec));
      ASSERT_FALSE(held.empty());
      const size_t pick = random() % held.size();
      const bool dies_with_surface_stored = uniform(random) < death_rate;
      if (dies_with_surface_stored) {
        PutFiltered(held[pick]);
      } else {
        ASSERT_TRUE(Finish(held[pick]).ok());
        held.erase(held.begin() + static_cast<std::ptrdiff_t>(pick));
      }
      if (dies_with_surface_stored || uniform(random) < death_rate) {
        held.clear();
        OpenConductor();
      }
    }
  }

  std::vector<std::string> AcceptedDigests() const {
    std::vector<std::string> digests;
    for (const AcceptedSurface& surface : conductor_->AcceptedSurfaces()) {
      digests.push_back(absl::StrCat(surface.sequence, ":", surface.camera, ":", surface.digest));
    }
    return digests;
  }

  std::string folder_;
  Wall wall_ = MakeWall(10);
  ManualClock clock_;
  ThreadPool pool_{1};
  ConductorOptions options_;
  std::string store_path_;
  std::unique_ptr<BlobStore> blobs_;
  std::unique_ptr<JobStore> store_;
  std::unique_ptr<Conductor> conductor_;
};

TEST_F(ConductorTest, TheAnswerDoesNotDependOnTheOrderOfResults) {
  StartAnew("reference", {});
  RunToTheEnd(0, 0);
  const std::vector<std::string> expected = AcceptedDigests();
  EXPECT_FALSE(expected.empty());
  const Progress progress = conductor_->progress();
  EXPECT_EQ(progress.cameras_committed, 10);
  EXPECT_EQ(progress.cameras_total, 10);
  EXPECT_EQ(store_->GetReconstruction("wall")->state, ReconstructionState::kDone);
  for (unsigned seed = 1; seed < 4; ++seed) {
    StartAnew(absl::StrCat("run", seed), {});
    RunToTheEnd(seed, 0);
    EXPECT_EQ(AcceptedDigests(), expected);
  }
}

TEST_F(ConductorTest, TheAnswerDoesNotDependOnDeaths) {
  StartAnew("reference", {});
  RunToTheEnd(0, 0);
  const std::vector<std::string> expected = AcceptedDigests();
  for (unsigned seed = 1; seed < 4; ++seed) {
    StartAnew(absl::StrCat("run", seed), {});
    RunToTheEnd(seed, 0.4);
    EXPECT_EQ(AcceptedDigests(), expected);
    const Progress progress = conductor_->progress();
    OpenConductor();
    EXPECT_TRUE(conductor_->finished());
    EXPECT_EQ(AcceptedDigests(), expected);
    EXPECT_EQ(conductor_->progress().patches_accepted, progress.patches_accepted);
    EXPECT_EQ(conductor_->progress().patches_filtered, progress.patches_filtered);
  }
}

TEST_F(ConductorTest, JobsSeeExactlyTheSurfacesOfTheirSnapshot) {
  StartAnew("run", {});
  std::vector<CameraJobSpec> held = conductor_->TakeJobs();
  while (!conductor_->finished()) {
    ASSERT_FALSE(held.empty());
    for (const CameraJobSpec& spec : held) {
      for (const AcceptedSurface& surface : spec.accepted) EXPECT_LE(surface.sequence, spec.snapshot);
      EXPECT_LT(spec.snapshot, spec.sequence);
      EXPECT_FALSE(spec.targets.empty());
      for (const CameraIndex target : spec.targets) EXPECT_THAT(spec.neighbours, testing::Contains(target));
    }
    ASSERT_TRUE(Finish(held.front()).ok());
    held.erase(held.begin());
    // Opened anew, the conductor hands out the same jobs with the same snapshots.
    std::vector<CameraJobSpec> more = conductor_->TakeJobs();
    held.insert(held.end(), more.begin(), more.end());
    OpenConductor();
    std::vector<CameraJobSpec> again = conductor_->TakeJobs();
    ASSERT_EQ(again.size(), held.size());
    for (size_t i = 0; i < held.size(); ++i) {
      EXPECT_EQ(again[i].sequence, held[i].sequence);
      EXPECT_EQ(again[i].camera, held[i].camera);
      EXPECT_EQ(again[i].snapshot, held[i].snapshot);
      EXPECT_EQ(again[i].targets, held[i].targets);
      EXPECT_EQ(again[i].accepted.size(), held[i].accepted.size());
      EXPECT_GT(again[i].epoch, held[i].epoch);
    }
    held = again;
  }
}

TEST_F(ConductorTest, AResultFromBeforeARestartIsRefused) {
  StartAnew("run", {});
  const std::vector<CameraJobSpec> before = conductor_->TakeJobs();
  OpenConductor();
  EXPECT_TRUE(absl::IsAborted(Finish(before.front())));
  EXPECT_EQ(conductor_->progress().cameras_committed, 0);
}

TEST_F(ConductorTest, RepeatedResultsAreHarmless) {
  StartAnew("run", {});
  const std::vector<CameraJobSpec> held = conductor_->TakeJobs();
  EXPECT_TRUE(Finish(held.front()).ok());
  EXPECT_TRUE(Finish(held.front()).ok());
  EXPECT_EQ(conductor_->progress().cameras_committed, 1);
}

TEST_F(ConductorTest, ResultsThatDoNotFitAreRefused) {
  StartAnew("run", {});
  const CameraJobSpec spec = conductor_->TakeJobs().front();
  EXPECT_TRUE(absl::IsNotFound(conductor_->Complete(77, 1, PutFiltered(spec), {}, "{}")));
  EXPECT_TRUE(
      absl::IsInvalidArgument(conductor_->Complete(spec.sequence, spec.epoch, PutFiltered(spec), {spec.camera}, "{}")));
  EXPECT_TRUE(
      absl::IsFailedPrecondition(conductor_->Complete(spec.sequence, spec.epoch, std::string(64, 'a'), {}, "{}")));
  EXPECT_EQ(conductor_->progress().cameras_committed, 0);
  EXPECT_TRUE(Finish(spec).ok());
}

TEST_F(ConductorTest, ASkippedCameraIsNobodysTargetAndTheRestGoesOn) {
  StartAnew("run", {});
  const CameraJobSpec lost = conductor_->TakeJobs().front();
  ASSERT_TRUE(conductor_->Skip(lost.sequence, lost.epoch, "picture is gone").ok());
  OpenConductor();
  while (!conductor_->finished()) {
    for (const CameraJobSpec& spec : conductor_->TakeJobs()) {
      if (spec.snapshot >= lost.sequence) {
        EXPECT_THAT(spec.targets, testing::Not(testing::Contains(lost.camera)));
      }
      ASSERT_TRUE(Finish(spec).ok());
    }
  }
  EXPECT_EQ(conductor_->progress().cameras_skipped, 1);
  for (const AcceptedSurface& surface : conductor_->AcceptedSurfaces()) EXPECT_NE(surface.camera, lost.camera);
}

TEST_F(ConductorTest, AStoreOfOtherOptionsIsRefused) {
  StartAnew("run", {});
  RunToTheEnd(0, 0);
  options_.window = 1;
  options_.pairs.max_angle_deg = 8;
  conductor_.reset();
  const auto opened =
      Conductor::Open("wall", wall_.cameras, wall_.points, options_, store_.get(), blobs_.get(), &clock_, &pool_);
  EXPECT_TRUE(absl::IsDataLoss(opened.status())) << opened.status();
}

TEST_F(ConductorTest, ADamagedSurfaceIsNoticed) {
  StartAnew("run", {});
  const CameraJobSpec spec = conductor_->TakeJobs().front();
  const std::string digest = *blobs_->Put("not a surface");
  EXPECT_TRUE(absl::IsDataLoss(conductor_->Complete(spec.sequence, spec.epoch, digest, {}, "{}")));
}

TEST_F(ConductorTest, OptionsAreChecked) {
  ConductorOptions options;
  options.window = 0;
  EXPECT_TRUE(absl::IsInvalidArgument(options.Validate()));
}

}  // namespace
}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
