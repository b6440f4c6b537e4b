// SPDX-License-Identifier: Apache-2.0
#include "coordinator/api/reconstruction_service.h"

#include <cstdlib>
#include <filesystem>
#include <functional>
#include <set>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "common/base/check.h"
#include "common/base/clock.h"
#include "common/base/digest.h"
#include "common/base/files.h"
#include "common/base/method_version.h"
#include "common/blob/filesystem_blob_store.h"
#include "common/image/encode.h"
#include "common/scene/formats/export_colmap.h"
#include "common/scene/scene_codec.h"
#include "common/scene/view.h"
#include "common/surface/codec.h"
#include "coordinator/store/sqlite_job_store.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr int kCameras = 6;
constexpr double kWallDepth = 10;
constexpr int kStep = 2;

// Cameras side by side in front of a wall, in a folder ROOT/wall.
void WriteWall(const std::string& root) {
  Scene scene;
  fs::create_directories(root + "/wall/images");
  fs::create_directories(root + "/wall/model");
  for (int i = 0; i < kCameras; ++i) {
    SceneView view;
    view.name = absl::StrCat("v", i, ".png");
    view.lens = {.width = 64, .height = 48, .fx = 100, .fy = 100, .cx = 32, .cy = 24};
    view.cam_from_world.translation = {-static_cast<double>(i), 0, 0};
    MW_CHECK(WritePng(root + "/wall/images/" + view.name,
                      {64, 48, std::vector<uint8_t>(3 * 64 * 48, static_cast<uint8_t>(i))})
                 .ok());
    scene.views.push_back(view);
  }
  for (double x = -3; x < kCameras + 2; x += 0.25) {
    for (double y = -2; y <= 2; y += 0.5) {
      SparsePoint point;
      point.x_in_world = {x, y, kWallDepth};
      for (CameraIndex i = 0; i < kCameras; ++i) {
        if (std::abs(x - i) < 3.1) point.seen_by.push_back(i);
      }
      if (point.seen_by.size() >= 2) scene.points.push_back(point);
    }
  }
  MW_CHECK(ExportColmapText(scene, root + "/wall/model").ok());
}

absl::StatusOr<ReconstructionConfig> ParseTestMethod(const std::string& options_json) {
  if (options_json == "bad") return absl::InvalidArgumentError("options_json: bad");
  ReconstructionConfig config = {.options_json = options_json.empty() ? "{}" : options_json};
  config.join.min_component_faces = 0;
  config.job_bytes = [](const CameraJobSpec&, const std::vector<Camera>&) { return 1000; };
  return config;
}

class ReconstructionServiceTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = testing::TempDir() + "api_XXXXXX";
    MW_CHECK(mkdtemp(pattern.data()) != nullptr);
    folder_ = pattern;
    WriteWall(folder_ + "/roots");
    blobs_ = *FilesystemBlobStore::Open(folder_ + "/blobs");
    Open();
  }
  void TearDown() override {
    service_.reset();
    fs::remove_all(folder_);
  }

  // As a coordinator that is started anew.
  void Open(int64_t method_version = kMethodVersion) {
    service_.reset();
    workers_.reset();
    store_.reset();
    store_ = *OpenSqliteJobStore(folder_ + "/state.sqlite");
    workers_ = std::make_unique<WorkerService>(kLease, kRetry, *store_);
    service_ = OpenService(
        {.data_folder = folder_ + "/data", .scene_roots = {folder_ + "/roots"}, .method_version = method_version},
        *workers_);
  }
  std::unique_ptr<ReconstructionService> OpenService(const ReconstructionServiceOptions& options,
                                                     WorkerService& workers) {
    auto opened = ReconstructionService::Open(
        options,
        {.store = store_.get(),
         .blobs = blobs_.get(),
         .clock = &clock_,
         .pool = &pool_,
         .jobs_changed =
             [&workers, tell = options.tell_others] {
               workers.Wake();
               tell({StoreNews::About::kJobs, ""});
             },
         .parse_config = ParseTestMethod,
         .list_photographs = [](const std::string&) { return std::vector<PhotographFile>(); },
         .max_failures = kRetry.max_failures},
        workers);
    MW_CHECK(opened.ok());
    return *std::move(opened);
  }

  void CreateAndStart(const std::string& id) {
    v1::CreateReconstructionRequest request;
    request.set_id(id);
    request.set_scene_reference("file:wall");
    ASSERT_TRUE(service_->Create(request).ok());
    ASSERT_TRUE(service_->Start(id).ok());
  }

  // The wall as the job's camera sees it.
  std::string PutFiltered(const v1::CameraJob& job) {
    const Scene scene = *DecodeScene(*blobs_->Get(job.scene_digest()));
    const Camera camera = UndistortedCamera(scene.views[static_cast<size_t>(job.camera())], 0);
    PatchLattice surface = PatchLattice::Empty(job.camera(), camera, kStep);
    for (int row = 0; row < surface.lattice.rows; ++row) {
      for (int column = 0; column < surface.lattice.columns; ++column) {
        const auto node = static_cast<size_t>(surface.lattice.Index(column, row));
        surface.depth[node] = static_cast<float>(kWallDepth);
        surface.normal_in_world[node] = {0, 0, -1};
        surface.quality[node] = 0.9F;
        if (column + 1 < surface.lattice.columns) surface.links[node] |= PatchLattice::kLinkRight;
        if (row + 1 < surface.lattice.rows) surface.links[node] |= PatchLattice::kLinkDown;
      }
    }
    return *blobs_->Put(EncodeSurface(surface));
  }

  // A worker that does what `work` says with each of its jobs, until `jobs` are done or all reconstructions are over.
  void RunWorker(const std::string& worker, int jobs,
                 const std::function<void(const v1::CameraJob&, v1::HeldJob&)>& work) {
    v1::SynchronizeRequest request;
    request.set_worker_id(worker);
    request.set_instance("1");
    request.set_cores(1);
    request.set_memory_bytes(1 << 20);
    request.set_method_version(kMethodVersion);
    request.set_wait_timeout_seconds(0.05);
    const Stopwatch waited;
    while (jobs > 0 && waited.Elapsed() < absl::Seconds(60) && !AllOver()) {
      const auto response = workers_->Synchronize(request, [] { return false; });
      ASSERT_TRUE(response.ok()) << response.status();
      request.clear_held();
      for (const v1::CameraJob& job : response->jobs()) {
        v1::HeldJob& held = *request.add_held();
        *held.mutable_key() = job.key();
        work(job, held);
        --jobs;
      }
    }
    ASSERT_TRUE(workers_->Synchronize(request, [] { return false; }).ok());
  }
  void Finish(const v1::CameraJob& job, v1::HeldJob& held) {
    held.mutable_finished()->set_filtered_digest(PutFiltered(job));
    held.mutable_finished()->set_report_json("{}");
  }
  bool AllOver() const {
    const v1::ListReconstructionsResponse all = *service_->List(v1::ListReconstructionsRequest());
    for (const v1::Reconstruction& reconstruction : all.reconstructions()) {
      if (!IsOver(reconstruction.state())) return false;
    }
    return true;
  }
  v1::Reconstruction WaitFor(const std::string& id) {
    v1::Reconstruction last;
    const absl::Status status = service_->Watch(
        id, [] { return false; },
        [&](const v1::Reconstruction& now) {
          last = now;
          return true;
        });
    EXPECT_TRUE(status.ok()) << status;
    return last;
  }
  std::string Mesh(const std::string& id) { return *ReadFile(*service_->MeshPath(id)); }

  static inline const LeaseOptions kLease = {.lease = absl::Seconds(30), .job_time_limit = absl::Hours(1)};
  static inline const RetryOptions kRetry = {.backoff = absl::Milliseconds(1)};

  std::string folder_;
  RealClock clock_;
  ThreadPool pool_{1};
  std::unique_ptr<BlobStore> blobs_;
  std::unique_ptr<JobStore> store_;
  std::unique_ptr<WorkerService> workers_;
  std::unique_ptr<ReconstructionService> service_;
};

// The files of one reconstruction are another's, also when the first one is deleted.
TEST_F(ReconstructionServiceTest, AgainWithOtherOptionsSendsNothingAgain) {
  v1::CreateReconstructionRequest request;
  request.set_id("first");
  ASSERT_TRUE(service_->Create(request).ok());
  for (const auto& entry : fs::recursive_directory_iterator(folder_ + "/roots/wall")) {
    if (!entry.is_regular_file()) continue;
    const std::string bytes = *ReadFile(entry.path());
    v1::UploadSceneFileRequest::Header header;
    header.set_reconstruction_id("first");
    header.set_path(fs::relative(entry.path(), folder_ + "/roots/wall").string());
    header.set_size_bytes(static_cast<int64_t>(bytes.size()));
    header.set_sha256(Sha256Hex(bytes));
    auto upload = service_->BeginUpload(header);
    ASSERT_TRUE(upload.ok() && upload->Append(bytes).ok() && upload->Finish().ok());
  }
  request.set_id("second");
  request.set_options_json(R"({"other": 1})");
  ASSERT_TRUE(service_->CreateAgain("first", request).ok());
  ASSERT_TRUE(service_->CreateAgain("first", request).ok());
  EXPECT_EQ(*service_->ListSceneFiles("second"), *service_->ListSceneFiles("first"));
  EXPECT_EQ(service_->ListSceneFiles("second")->size(), kCameras + 3U);
  ASSERT_TRUE(service_->Delete("first").ok());
  ASSERT_TRUE(service_->Start("second").ok());
  RunWorker("w", 1000, [&](const v1::CameraJob& job, v1::HeldJob& held) { Finish(job, held); });
  EXPECT_EQ(WaitFor("second").state(), v1::RECONSTRUCTION_STATE_DONE);

  CreateAndStart("by-reference");
  request.set_id("third");
  EXPECT_EQ(service_->CreateAgain("by-reference", request)->scene_reference(), "file:wall");
  EXPECT_TRUE(absl::IsNotFound(service_->CreateAgain("nowhere", request).status()));
}

TEST_F(ReconstructionServiceTest, AMeshIsMadeWhoeverFailsNowAndThen) {
  CreateAndStart("quiet");
  RunWorker("w", 1000, [&](const v1::CameraJob& job, v1::HeldJob& held) { Finish(job, held); });
  EXPECT_EQ(WaitFor("quiet").state(), v1::RECONSTRUCTION_STATE_DONE);
  EXPECT_EQ(service_->ListCameras("quiet")->cameras_size(), kCameras);
  EXPECT_GT(service_->ListParts("quiet")->parts_size(), 0);

  CreateAndStart("restless");
  int calls = 0;
  RunWorker("w", 1000, [&](const v1::CameraJob& job, v1::HeldJob& held) {
    switch (++calls % 4) {
      case 0:
        held.mutable_released();
        break;
      case 1:
        held.mutable_failed()->set_reason("no way to the blobs");
        held.mutable_failed()->set_infrastructure(true);
        break;
      default:
        Finish(job, held);
        break;
    }
  });
  const v1::Reconstruction restless = WaitFor("restless");
  EXPECT_EQ(restless.state(), v1::RECONSTRUCTION_STATE_DONE) << restless.failure();
  EXPECT_EQ(restless.progress().cameras_skipped(), 0);
  EXPECT_TRUE(Mesh("quiet") == Mesh("restless"));
}

TEST_F(ReconstructionServiceTest, ACameraThatFailsThreeTimesIsSkippedWithItsReason) {
  CreateAndStart("wall");
  int poisoned = 0;
  RunWorker("w", 1000, [&](const v1::CameraJob& job, v1::HeldJob& held) {
    if (job.camera() == 3) {
      held.mutable_failed()->set_reason(absl::StrCat("picture broken, attempt ", ++poisoned));
    } else {
      Finish(job, held);
    }
  });
  const v1::Reconstruction done = WaitFor("wall");
  EXPECT_EQ(done.state(), v1::RECONSTRUCTION_STATE_DONE) << done.failure();
  EXPECT_EQ(poisoned, 3);
  EXPECT_EQ(done.progress().cameras_skipped(), 1);
  const auto cameras = service_->ListCameras("wall");
  EXPECT_EQ(cameras->cameras(3).state(), v1::CAMERA_STATE_SKIPPED);
  EXPECT_EQ(cameras->cameras(3).skip_reason(), "picture broken, attempt 3");
}

TEST_F(ReconstructionServiceTest, AWorkerWhoseWordIsWorthNothingHarmsNobody) {
  CreateAndStart("wall");
  int lies = 0;
  RunWorker("w", 1000, [&](const v1::CameraJob& job, v1::HeldJob& held) {
    Finish(job, held);
    if (lies < 2) {
      // A surface that is nowhere; a target that is none.
      if (lies == 0) held.mutable_finished()->set_filtered_digest(std::string(64, '0'));
      if (lies == 1) held.mutable_finished()->add_weak_targets(99);
      ++lies;
    }
  });
  const v1::Reconstruction done = WaitFor("wall");
  EXPECT_EQ(done.state(), v1::RECONSTRUCTION_STATE_DONE) << done.failure();
  EXPECT_EQ(done.progress().cameras_skipped(), 0);
}

// An upgrade in the middle, and back: what was begun waits with a warning, and is not touched.
TEST_F(ReconstructionServiceTest, WhatWasBegunWithAnotherMethodWaitsForACoordinatorThatHasIt) {
  CreateAndStart("wall");
  RunWorker("w", 2, [&](const v1::CameraJob& job, v1::HeldJob& held) { Finish(job, held); });
  Open(kMethodVersion + 1);
  const size_t committed = store_->ListCommits("wall")->size();
  const ConductorLease before = *store_->GetConductorLease("wall");
  absl::SleepFor(absl::Seconds(2));
  EXPECT_EQ(store_->GetConductorLease("wall")->epoch, before.epoch);
  EXPECT_EQ(store_->ListCommits("wall")->size(), committed);
  const v1::Reconstruction waiting = *service_->Get("wall");
  EXPECT_FALSE(IsOver(waiting.state())) << waiting.failure();
  ASSERT_GE(waiting.warnings_size(), 1);
  EXPECT_THAT(waiting.warnings(0), HasSubstr(absl::StrCat("begun with version ", kMethodVersion, " of the method")));
  Open();
  RunWorker("w", 1000, [&](const v1::CameraJob& job, v1::HeldJob& held) { Finish(job, held); });
  const v1::Reconstruction done = WaitFor("wall");
  EXPECT_EQ(done.state(), v1::RECONSTRUCTION_STATE_DONE) << done.failure();
  EXPECT_EQ(done.progress().cameras_skipped(), 0);
}

TEST_F(ReconstructionServiceTest, NobodyIsAtACameraOfWhatWasCancelled) {
  CreateAndStart("wall");
  RunWorker("w", 2, [&](const v1::CameraJob& job, v1::HeldJob& held) { Finish(job, held); });
  ASSERT_TRUE(service_->Cancel("wall").ok());
  int committed = 0;
  const v1::ListCamerasResponse listed = *service_->ListCameras("wall");
  for (const v1::Camera& camera : listed.cameras()) {
    EXPECT_TRUE(camera.state() == v1::CAMERA_STATE_COMMITTED || camera.state() == v1::CAMERA_STATE_WAITING)
        << camera.name() << ": " << v1::CameraState_Name(camera.state());
    committed += camera.state() == v1::CAMERA_STATE_COMMITTED ? 1 : 0;
  }
  EXPECT_EQ(committed, service_->Get("wall")->progress().cameras_committed());
  EXPECT_LT(committed, kCameras);
}

// The store's clock was set back an hour, and the coordinator that held the lease is gone.
TEST_F(ReconstructionServiceTest, AnotherTakesOverWhateverTheClockSays) {
  v1::CreateReconstructionRequest request;
  request.set_id("wall");
  request.set_scene_reference("file:wall");
  ASSERT_TRUE(service_->Create(request).ok());
  const absl::Time now = SystemClock().Now();
  ASSERT_TRUE(store_->AcquireConductorLease("wall", "another", now + absl::Hours(1), now).ok());
  ASSERT_TRUE(service_->Start("wall").ok());
  RunWorker("w", 1000, [&](const v1::CameraJob& job, v1::HeldJob& held) { Finish(job, held); });
  EXPECT_EQ(WaitFor("wall").state(), v1::RECONSTRUCTION_STATE_DONE);
}

// North conducts, and south, which has not the method, has the workers: each hears of the other what there is to do.
TEST_F(ReconstructionServiceTest, CoordinatorsTellEachOther) {
  Mutex mutex;
  std::set<StoreNews> told_by_north;
  std::set<StoreNews> told_by_south;
  WorkerService north_workers(kLease, kRetry, *store_);
  std::unique_ptr<ReconstructionService> north;
  service_.reset();
  service_ = OpenService({.data_folder = folder_ + "/data",
                          .scene_roots = {folder_ + "/roots"},
                          .name = "south",
                          .method_version = kMethodVersion + 1,
                          .tell_others =
                              [&](const StoreNews& news) {
                                const MutexLock lock(mutex);
                                told_by_south.insert(news);
                                if (north != nullptr) north->Hear(news);
                              }},
                         *workers_);
  {
    const MutexLock lock(mutex);
    north = OpenService({.data_folder = folder_ + "/north",
                         .scene_roots = {folder_ + "/roots"},
                         .name = "north",
                         .tell_others =
                             [&](const StoreNews& news) {
                               const MutexLock lock(mutex);
                               told_by_north.insert(news);
                               service_->Hear(news);
                             }},
                        north_workers);
  }
  v1::CreateReconstructionRequest request;
  request.set_id("wall");
  request.set_scene_reference("file:wall");
  ASSERT_TRUE(north->Create(request).ok());
  ASSERT_TRUE(service_->Start("wall").ok());
  RunWorker("ant", 1000, [&](const v1::CameraJob& job, v1::HeldJob& held) { Finish(job, held); });
  EXPECT_EQ(WaitFor("wall").state(), v1::RECONSTRUCTION_STATE_DONE);
  north.reset();
  service_.reset();
  EXPECT_THAT(told_by_south, testing::ElementsAre(StoreNews{StoreNews::About::kResults, "wall"},
                                                  StoreNews{StoreNews::About::kStates, "wall"}));
  EXPECT_THAT(told_by_north, testing::ElementsAre(StoreNews{StoreNews::About::kJobs, ""}));
}

TEST_F(ReconstructionServiceTest, ACoordinatorThatIsStartedAnewGoesOn) {
  CreateAndStart("whole");
  RunWorker("w", 1000, [&](const v1::CameraJob& job, v1::HeldJob& held) { Finish(job, held); });
  ASSERT_EQ(WaitFor("whole").state(), v1::RECONSTRUCTION_STATE_DONE);
  CreateAndStart("broken");
  for (int i = 0; i < 4; ++i) {
    RunWorker("w", 2, [&](const v1::CameraJob& job, v1::HeldJob& held) { Finish(job, held); });
    Open();
  }
  RunWorker("w", 1000, [&](const v1::CameraJob& job, v1::HeldJob& held) { Finish(job, held); });
  EXPECT_EQ(WaitFor("broken").state(), v1::RECONSTRUCTION_STATE_DONE);
  EXPECT_TRUE(Mesh("whole") == Mesh("broken"));
}

TEST_F(ReconstructionServiceTest, PagesGoThroughAll) {
  for (int i = 0; i < 7; ++i) {
    v1::CreateReconstructionRequest request;
    request.set_id(absl::StrCat("r", i));
    ASSERT_TRUE(service_->Create(request).ok());
  }
  v1::ListReconstructionsRequest request;
  request.set_page_size(3);
  std::vector<std::string> ids;
  do {
    const auto page = service_->List(request);
    ASSERT_TRUE(page.ok());
    EXPECT_LE(page->reconstructions_size(), 3);
    for (const v1::Reconstruction& reconstruction : page->reconstructions()) ids.push_back(reconstruction.id());
    request.set_page_token(page->next_page_token());
  } while (!request.page_token().empty());
  EXPECT_THAT(ids, testing::ElementsAre("r0", "r1", "r2", "r3", "r4", "r5", "r6"));
  request.set_page_size(-1);
  EXPECT_THAT(std::string(service_->List(request).status().message()), HasSubstr("page_size"));
}

TEST_F(ReconstructionServiceTest, AScenesAuthorReadsNothingElse) {
  MW_CHECK(WriteFileAtomically(folder_ + "/secret.txt", "the password is hunter2\n").ok());
  MW_CHECK(WritePng(folder_ + "/secret.png", {64, 48, std::vector<uint8_t>(3 * 64 * 48)}).ok());
  const std::string wall = folder_ + "/roots/wall";
  const auto replace = [&](const std::string& name, const std::string& target) {
    fs::remove(wall + name);
    fs::create_symlink(target, wall + name);
  };
  const auto rename_photograph = [&](const std::string& to) {
    const std::string path = wall + "/model/images.txt";
    MW_CHECK(WriteFileAtomically(path, absl::StrReplaceAll(*ReadFile(path), {{"v0.png", to}})).ok());
  };
  const std::pair<const char*, std::function<void()>> attacks[] = {
      {"photograph-link", [&] { replace("/images/v0.png", folder_ + "/secret.png"); }},
      {"model-link", [&] { replace("/model/cameras.txt", folder_ + "/secret.txt"); }},
      {"folder-link",
       [&] {
         fs::rename(wall + "/images", folder_ + "/elsewhere");
         fs::create_directory_symlink(folder_ + "/elsewhere", wall + "/images");
       }},
      {"device", [&] { replace("/images/v0.png", "/dev/zero"); }},
      {"pipe",
       [&] {
         fs::remove(wall + "/images/v0.png");
         MW_CHECK(::mkfifo((wall + "/images/v0.png").c_str(), 0600) == 0);
       }},
      {"name", [&] { rename_photograph("../../../secret.png"); }},
      {"absolute-name", [&] { rename_photograph(folder_ + "/secret.png"); }}};
  for (const auto& [id, spoil] : attacks) {
    fs::remove_all(wall);
    fs::remove_all(folder_ + "/elsewhere");
    WriteWall(folder_ + "/roots");
    spoil();
    CreateAndStart(id);
    v1::Reconstruction last;
    ASSERT_TRUE(service_
                    ->Watch(
                        id, [] { return false; },
                        [&](const v1::Reconstruction& now) {
                          last = now;
                          return now.state() != v1::RECONSTRUCTION_STATE_RUNNING;
                        })
                    .ok())
        << id << ": " << last.DebugString();
    EXPECT_EQ(last.state(), v1::RECONSTRUCTION_STATE_FAILED) << id;
    EXPECT_THAT(last.failure(), testing::Not(HasSubstr(folder_))) << id;
    EXPECT_THAT(last.failure(), testing::Not(HasSubstr("hunter2"))) << id;
  }
}

TEST_F(ReconstructionServiceTest, AnUploadIsThereWholeOrNotAtAll) {
  v1::CreateReconstructionRequest request;
  request.set_id("up");
  ASSERT_TRUE(service_->Create(request).ok());
  v1::UploadSceneFileRequest::Header header;
  header.set_reconstruction_id("up");
  header.set_path("a/b.txt");
  header.set_size_bytes(4);
  header.set_sha256(Sha256Hex(std::string("wall")));
  const auto send = [&](const std::string& bytes) {
    auto upload = service_->BeginUpload(header);
    MW_CHECK(upload.ok());
    if (const absl::Status status = upload->Append(bytes); !status.ok()) return status;
    return upload->Finish();
  };
  for (const char* wrong : {"wal", "walls", "Wall"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(send(wrong)));
    EXPECT_TRUE(service_->ListSceneFiles("up")->empty());
  }
  EXPECT_TRUE(send("wall").ok());
  EXPECT_THAT(*service_->ListSceneFiles("up"), testing::ElementsAre(SceneFile{"a/b.txt", 4, header.sha256()}));
  EXPECT_EQ(*blobs_->Get(header.sha256()), "wall");
  EXPECT_TRUE(fs::is_empty(service_->staging_folder()));
}

}  // namespace
}  // namespace meshwright
