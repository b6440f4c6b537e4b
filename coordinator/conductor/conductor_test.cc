// SPDX-License-Identifier: Apache-2.0
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
#include "common/job/job_spec_codec.h"
#include "common/surface/codec.h"
#include "coordinator/conductor/outer_loop.h"
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
    loop_.reset();
    options_ = options;
    store_path_ = absl::StrCat(folder_, "/", name, ".sqlite");
    blobs_ = *FilesystemBlobStore::Open(absl::StrCat(folder_, "/", name));
    store_ = *OpenSqliteJobStore(store_path_);
    ASSERT_TRUE(store_->CreateReconstruction({"wall", "{}", std::string(64, '0')}, clock_.Now()).ok());
    OpenLoop();
  }

  // As a process that is started anew, workers included, does it.
  void OpenLoop() {
    loop_.reset();
    store_ = *OpenSqliteJobStore(store_path_);
    const std::vector<OpenJob> open = *store_->ListOpenJobs();
    for (const OpenJob& job : open) {
      if (!job.lease_worker.empty()) Change(ChangeOf(JobChange::Kind::kRelease, job.sequence, job.epoch));
    }
    epoch_ = *store_->AcquireConductorLease("wall", "test", clock_.Now() + absl::Minutes(1), clock_.Now());
    const ReconstructionConfig config = {
        .conductor = options_,
        .job_bytes = [](const CameraJobSpec& spec, const std::vector<Camera>&) { return 8 >> spec.reduction; }};
    auto opened = OuterLoop::Open({.store = store_.get(), .blobs = blobs_.get(), .clock = &clock_, .pool = &pool_},
                                  "wall", epoch_, wall_.cameras, wall_.points, config);
    ASSERT_TRUE(opened.ok()) << opened.status();
    loop_ = *std::move(opened);
    ASSERT_TRUE(loop_->Step().ok());
  }

  static JobChange ChangeOf(JobChange::Kind kind, SequenceNumber sequence, int64_t epoch) {
    return {.kind = kind, .id = "wall", .sequence = sequence, .epoch = epoch, .worker = "w", .instance = "1"};
  }
  JobChangeResult Change(JobChange change) {
    change.expires_at = clock_.Now() + absl::Minutes(1);
    return store_->ApplyChanges({change}, {}, clock_.Now())->front();
  }

  // Claims all jobs that wait, by sequence.
  std::vector<CameraJobSpec> TakeJobs() {
    std::vector<CameraJobSpec> taken;
    const std::vector<OpenJob> open = *store_->ListOpenJobs();
    for (const OpenJob& waiting : open) {
      if (!waiting.lease_worker.empty()) continue;
      const CameraJob job = *Change(ChangeOf(JobChange::Kind::kClaim, waiting.sequence, waiting.epoch)).job;
      const StoredJobSpec stored = *DecodeJobSpec(job.spec);
      taken.push_back({.sequence = job.sequence,
                       .camera = job.camera,
                       .snapshot = job.snapshot,
                       .epoch = job.epoch,
                       .neighbours = job.neighbours,
                       .targets = stored.targets,
                       .accepted = stored.accepted});
    }
    return taken;
  }

  std::string PutFiltered(const CameraJobSpec& spec) {
    return *blobs_->Put(EncodeSurface(FakeFilteredSurface(wall_, spec)));
  }

  // What a worker says, before anybody looks at it.
  absl::Status Report(const CameraJobSpec& spec, const std::string& digest,
                      const std::vector<CameraIndex>& weak_targets = {}, const std::string& report_json = "{}") {
    JobChange change = ChangeOf(JobChange::Kind::kComplete, spec.sequence, spec.epoch);
    change.filtered_digest = digest;
    change.weak_targets = weak_targets;
    change.report_json = report_json;
    return Change(change).status;
  }

  absl::Status Finish(const CameraJobSpec& spec) {
    const absl::Status reported = Report(spec, PutFiltered(spec));
    return reported.ok() ? loop_->Step().status() : reported;
  }

  bool finished() const { return loop_->conductor().finished(); }
  int64_t committed() const { return loop_->conductor().progress().cameras_committed; }

  // Runs to the end, finishing jobs in an order drawn from `seed` and dying now and then.
  void RunToTheEnd(unsigned seed, double death_rate) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(0, 1);
    std::vector<CameraJobSpec> held;
    while (!finished()) {
      for (CameraJobSpec& spec : TakeJobs()) held.push_back(std::move(spec));
      ASSERT_FALSE(held.empty());
      const size_t pick = random() % held.size();
      const bool dies_with_surface_stored = uniform(random) < death_rate;
      const bool dies_with_result_stored = uniform(random) < death_rate;
      if (dies_with_surface_stored) {
        PutFiltered(held[pick]);
      } else if (dies_with_result_stored) {
        ASSERT_TRUE(Report(held[pick], PutFiltered(held[pick])).ok());
      } else {
        ASSERT_TRUE(Finish(held[pick]).ok());
        held.erase(held.begin() + static_cast<std::ptrdiff_t>(pick));
      }
      if (dies_with_surface_stored || dies_with_result_stored || uniform(random) < death_rate) {
        held.clear();
        OpenLoop();
      }
    }
  }

  std::vector<std::string> AcceptedDigests() const {
    std::vector<std::string> digests;
    for (const AcceptedSurface& surface : loop_->conductor().AcceptedSurfaces()) {
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
  int64_t epoch_ = 0;  // of the conductor's lease
  std::unique_ptr<OuterLoop> loop_;
};

TEST_F(ConductorTest, TheAnswerDoesNotDependOnTheOrderOfResults) {
  StartAnew("reference", {});
  RunToTheEnd(0, 0);
  const std::vector<std::string> expected = AcceptedDigests();
  EXPECT_FALSE(expected.empty());
  const Progress progress = loop_->conductor().progress();
  EXPECT_EQ(progress.cameras_committed, 10);
  EXPECT_EQ(progress.cameras_total, 10);
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
    const Progress progress = loop_->conductor().progress();
    OpenLoop();
    EXPECT_TRUE(finished());
    EXPECT_EQ(AcceptedDigests(), expected);
    EXPECT_EQ(loop_->conductor().progress().patches_accepted, progress.patches_accepted);
    EXPECT_EQ(loop_->conductor().progress().patches_filtered, progress.patches_filtered);
  }
}

TEST_F(ConductorTest, JobsSeeExactlyTheSurfacesOfTheirSnapshot) {
  StartAnew("run", {});
  std::vector<CameraJobSpec> held = TakeJobs();
  while (!finished()) {
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
    std::vector<CameraJobSpec> more = TakeJobs();
    held.insert(held.end(), more.begin(), more.end());
    OpenLoop();
    std::vector<CameraJobSpec> again = TakeJobs();
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

// Jobs of ten seconds, one after the other: what is foretold is what is left of them, also by a process that goes on.
TEST_F(ConductorTest, TheEndIsForetoldByWhatJobsTook) {
  constexpr absl::Duration kJob = absl::Seconds(10);
  StartAnew("run", {});
  const auto expected_end = [&] { return loop_->conductor().progress().expected_end; };
  EXPECT_EQ(expected_end(), absl::InfinitePast()) << "nothing is known yet";
  std::vector<CameraJobSpec> held = TakeJobs();
  while (!finished()) {
    ASSERT_FALSE(held.empty());
    clock_.Advance(kJob);
    ASSERT_TRUE(Report(held.front(), PutFiltered(held.front()), {}, R"({"seconds": {"loading": 10}})").ok());
    ASSERT_TRUE(loop_->Step().ok());
    held.erase(held.begin());
    const auto left = static_cast<double>(10 - committed());
    if (committed() == 5) {
      OpenLoop();
      held.clear();
      EXPECT_EQ(expected_end(), absl::InfinitePast()) << "how many work at it now is not known yet";
    } else if (left > 0 && committed() > 1) {
      const double foretold = absl::FDivDuration(expected_end() - clock_.Now(), kJob);
      EXPECT_GE(foretold, 0.7 * left) << committed();
      EXPECT_LE(foretold, 1.4 * left) << committed();
    }
    for (CameraJobSpec& spec : TakeJobs()) held.push_back(std::move(spec));
  }
}

TEST_F(ConductorTest, AResultFromBeforeARestartIsRefused) {
  StartAnew("run", {});
  const std::vector<CameraJobSpec> before = TakeJobs();
  OpenLoop();
  ASSERT_EQ(TakeJobs().size(), before.size());
  EXPECT_TRUE(absl::IsAborted(Finish(before.front())));
  EXPECT_EQ(committed(), 0);
}

TEST_F(ConductorTest, WhoLostTheLeaseChangesNothing) {
  StartAnew("run", {});
  const std::vector<CameraJobSpec> held = TakeJobs();
  clock_.Advance(absl::Minutes(2));
  ASSERT_TRUE(store_->AcquireConductorLease("wall", "other", clock_.Now() + absl::Minutes(1), clock_.Now()).ok());
  EXPECT_TRUE(absl::IsAborted(Finish(held.front())));
  EXPECT_TRUE(store_->ListCommits("wall")->empty());
  EXPECT_EQ(store_->ListCameraJobs("wall")->size(), held.size());
}

TEST_F(ConductorTest, RepeatedResultsAreHarmless) {
  StartAnew("run", {});
  const std::vector<CameraJobSpec> held = TakeJobs();
  EXPECT_TRUE(Finish(held.front()).ok());
  EXPECT_TRUE(absl::IsAborted(Finish(held.front())));
  EXPECT_TRUE(loop_->Step().ok());
  EXPECT_EQ(committed(), 1);
}

TEST_F(ConductorTest, ResultsThatAreNoneAreTakenBackAndThenTheJobIsSkipped) {
  StartAnew("run", {});
  CameraJobSpec spec = TakeJobs().front();
  const std::string none[] = {PutFiltered(spec), std::string(64, 'a'), *blobs_->Put("not a surface")};
  for (int64_t attempt = 0; attempt < 3; ++attempt) {
    const std::vector<CameraIndex> weak =
        attempt == 0 ? std::vector<CameraIndex>{spec.camera} : std::vector<CameraIndex>();
    ASSERT_TRUE(Report(spec, none[attempt], weak).ok());
    ASSERT_TRUE(loop_->Step().ok());
    EXPECT_EQ(store_->GetCameraJob("wall", spec.sequence)->failed_attempts, attempt + 1);
    EXPECT_EQ(committed(), 0);
    if (attempt < 2) spec = TakeJobs().front();
  }
  ASSERT_TRUE(loop_->Step().ok());
  EXPECT_EQ(store_->GetCameraJob("wall", spec.sequence)->state, CameraJobState::kSkipped);
  EXPECT_EQ(committed(), 1);
}

TEST_F(ConductorTest, ASurfaceOfAnotherCameraOrLatticeIsNone) {
  options_.lattice_step = kStep;
  StartAnew("run", options_);
  CameraJobSpec spec = TakeJobs().front();
  const PatchLattice right = FakeFilteredSurface(wall_, spec);
  int runs = 0;
  const auto expect_refused = [&](const PatchLattice& surface, const std::string& word) {
    ASSERT_TRUE(Report(spec, *blobs_->Put(EncodeSurface(surface))).ok());
    ASSERT_TRUE(loop_->Step().ok());
    EXPECT_THAT(store_->GetCameraJob("wall", spec.sequence)->last_failure, testing::HasSubstr(word));
    EXPECT_EQ(committed(), 0);
    StartAnew(absl::StrCat("run", ++runs), options_);
    spec = TakeJobs().front();
  };
  PatchLattice other = right;
  ++other.camera_index;
  expect_refused(other, "expected " + std::to_string(spec.camera));
  for (const double off : {1e-3, 1e6}) {
    other = right;
    other.camera.cam_from_world.translation.x() += off;
    expect_refused(other, "its camera");
    other = right;
    other.camera.fx += off;
    expect_refused(other, "its camera");
  }
  Camera larger = right.camera;
  larger.width = 8192;
  larger.height = 8192;
  expect_refused(PatchLattice::Empty(spec.camera, larger, kStep), "its camera");
  expect_refused(PatchLattice::Empty(spec.camera, right.camera, 1), "its lattice");
  // One that was made smaller.
  ASSERT_TRUE(
      Report(spec, *blobs_->Put(EncodeSurface(PatchLattice::Empty(spec.camera, right.camera, 2 * kStep)))).ok());
  ASSERT_TRUE(loop_->Step().ok());
  EXPECT_EQ(committed(), 1);
}

TEST_F(ConductorTest, AResultThatIsNoneDoesNotKeepAConductorFromOpening) {
  StartAnew("run", {});
  const CameraJobSpec spec = TakeJobs().front();
  ASSERT_TRUE(Report(spec, *blobs_->Put("not a surface")).ok());
  OpenLoop();
  EXPECT_EQ(store_->GetCameraJob("wall", spec.sequence)->failed_attempts, 1);
  RunToTheEnd(0, 0);
}

// Blobs that are damaged or lost are made again, from jobs or from acceptance, and nothing else changes.
TEST_F(ConductorTest, LostSurfacesAreMadeAgain) {
  StartAnew("reference", {});
  RunToTheEnd(0, 0);
  const std::vector<std::string> expected = AcceptedDigests();
  const std::vector<CameraJob> jobs = *store_->ListCameraJobs("wall");
  for (const CameraJob& job : jobs) ASSERT_TRUE(blobs_->Delete(job.filtered_digest).ok());
  const std::vector<Commit> commits = *store_->ListCommits("wall");
  for (const Commit& commit : commits) {
    if (commit.accepted_digest.empty()) continue;
    ASSERT_TRUE(blobs_->Delete(commit.accepted_digest).ok());
    ASSERT_TRUE(store_->ReportDamagedBlob("wall", commit.accepted_digest).ok());
  }
  ASSERT_TRUE(store_->ReportDamagedBlob("wall", std::string(64, 'f')).ok());  // nobody's
  for (int step = 0; step < 100; ++step) {
    const auto progress = loop_->Step();
    ASSERT_TRUE(progress.ok()) << progress.status();
    if (progress->finished) break;
    for (const CameraJobSpec& spec : TakeJobs()) ASSERT_TRUE(Report(spec, PutFiltered(spec)).ok());
  }
  EXPECT_TRUE(store_->ListDamagedBlobs("wall")->empty());
  EXPECT_EQ(AcceptedDigests(), expected);
  for (const AcceptedSurface& surface : loop_->conductor().AcceptedSurfaces()) {
    EXPECT_TRUE(blobs_->Get(surface.digest).ok());
  }
}

TEST_F(ConductorTest, ASkippedCameraIsNobodysTargetAndTheRestGoesOn) {
  StartAnew("run", {});
  const CameraJobSpec lost = TakeJobs().front();
  JobChange skip = ChangeOf(JobChange::Kind::kSkipped, lost.sequence, lost.epoch);
  skip.reason = "picture is gone";
  ASSERT_TRUE(Change(skip).status.ok());
  OpenLoop();
  while (!finished()) {
    for (const CameraJobSpec& spec : TakeJobs()) {
      if (spec.snapshot >= lost.sequence) {
        EXPECT_THAT(spec.targets, testing::Not(testing::Contains(lost.camera)));
      }
      ASSERT_TRUE(Finish(spec).ok());
    }
  }
  EXPECT_EQ(loop_->conductor().progress().cameras_skipped, 1);
  for (const AcceptedSurface& surface : loop_->conductor().AcceptedSurfaces()) EXPECT_NE(surface.camera, lost.camera);
}

TEST_F(ConductorTest, AStoreOfOtherOptionsIsRefused) {
  StartAnew("run", {});
  RunToTheEnd(0, 0);
  options_.window = 1;
  options_.pairs.max_angle_deg = 8;
  loop_.reset();
  const auto opened =
      Conductor::Open("wall", wall_.cameras, wall_.points, options_, store_.get(), blobs_.get(), &clock_, &pool_,
                      epoch_, [](const CameraJobSpec&) { return std::vector<int64_t>{1}; });
  EXPECT_TRUE(absl::IsDataLoss(opened.status())) << opened.status();
}

TEST_F(ConductorTest, OptionsAreChecked) {
  ConductorOptions options;
  options.window = 0;
  EXPECT_TRUE(absl::IsInvalidArgument(options.Validate()));
}

}  // namespace
}  // namespace meshwright
