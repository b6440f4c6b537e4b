// SPDX-License-Identifier: Apache-2.0
#include "worker/agent/agent.h"

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdlib>
#include <deque>
#include <filesystem>
#include <mutex>
#include <new>
#include <thread>

#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/base/check.h"
#include "common/base/clock.h"
#include "common/base/digest.h"
#include "common/blob/filesystem_blob_store.h"
#include "common/image/encode.h"
#include "common/scene/scene_codec.h"

namespace meshwright {
namespace {

using testing::HasSubstr;

constexpr std::chrono::seconds kLong(20);

// A coordinator that the test plays: it wants the jobs that the test names, and shows what the worker said.
class PlayedCoordinator : public WorkerChannel {
 public:
  absl::StatusOr<v1::SynchronizeResponse> Synchronize(const v1::SynchronizeRequest& request) override {
    std::unique_lock<std::mutex> lock(mutex_);
    said_.push_back(request);
    changed_.notify_all();
    if (!reachable_) return absl::UnavailableError("cut off");
    // As the real one: the answer waits while there is nothing new, and an interrupted call has none.
    const bool known = answered_ == version_;
    if (known) {
      changed_.wait_for(lock, std::chrono::duration<double>(request.wait_timeout_seconds()),
                        [&] { return interrupted_ || answered_ != version_; });
    }
    if (std::exchange(interrupted_, false) && known) return absl::CancelledError("interrupted");
    answered_ = version_;
    v1::SynchronizeResponse response;
    for (const v1::CameraJob& job : wanted_) *response.add_jobs() = job;
    return response;
  }
  void Interrupt() override {
    const std::lock_guard<std::mutex> lock(mutex_);
    interrupted_ = true;
    changed_.notify_all();
  }

  void Want(std::vector<v1::CameraJob> jobs) {
    const std::lock_guard<std::mutex> lock(mutex_);
    wanted_ = std::move(jobs);
    ++version_;
    changed_.notify_all();
  }
  void SetReachable(bool reachable) {
    const std::lock_guard<std::mutex> lock(mutex_);
    reachable_ = reachable;
  }
  // The first request from now on that `fits`.
  v1::SynchronizeRequest WaitFor(const std::function<bool(const v1::SynchronizeRequest&)>& fits) {
    std::unique_lock<std::mutex> lock(mutex_);
    while (true) {
      while (!said_.empty()) {
        const v1::SynchronizeRequest request = said_.front();
        said_.pop_front();
        if (fits(request)) return request;
      }
      if (changed_.wait_for(lock, kLong) == std::cv_status::timeout) {
        ADD_FAILURE() << "the worker does not say what it should";
        return {};
      }
    }
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<v1::SynchronizeRequest> said_;
  std::vector<v1::CameraJob> wanted_;
  int version_ = 1;
  int answered_ = 0;
  bool interrupted_ = false;
  bool reachable_ = true;
};

class AgentTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = testing::TempDir() + "agent_XXXXXX";
    MW_CHECK(mkdtemp(pattern.data()) != nullptr);
    folder_ = pattern;
    blobs_ = *FilesystemBlobStore::Open(folder_ + "/blobs");
    const std::string digest = *blobs_->Put(EncodePng({64, 48, std::vector<uint8_t>(3 * 64 * 48, 100)}));
    Scene scene = {.format = "colmap-text"};
    for (int i = 0; i < 2; ++i) {
      SceneView view = {.name = absl::StrCat("v", i, ".png"), .image_path = digest};
      view.lens = {.width = 64, .height = 48, .fx = 100, .fy = 100, .cx = 32, .cy = 24};
      view.cam_from_world.translation = {-static_cast<double>(i), 0, 0};
      scene.views.push_back(view);
    }
    scene_digest_ = *blobs_->Put(EncodeScene(scene));
  }
  void TearDown() override {
    Stop();
    std::filesystem::remove_all(folder_);
  }

  void Start(AgentJob job, absl::Duration drain = absl::Seconds(30),
             absl::Duration exit_when_idle = absl::InfiniteDuration()) {
    const auto parse = [](const std::string& options_json) -> absl::StatusOr<JobConfig> {
      if (!options_json.empty()) return absl::InvalidArgumentError("no such option");
      return JobConfig{};
    };
    const AgentOptions options = {
        .worker_id = "w", .cores = 2, .drain = drain, .exit_when_idle = exit_when_idle, .refiner = refiner_};
    agent_ = std::make_unique<Agent>(options, coordinator_, *blobs_, parse, std::move(job), Logger::Nowhere(), clock_);
    thread_ = std::thread([this] { agent_->Run(); });
  }
  void Stop() {
    if (thread_.joinable()) {
      coordinator_.SetReachable(true);
      coordinator_.Want({});
      agent_->Drain();
      thread_.join();
    }
    agent_.reset();
  }

  v1::CameraJob Job(int sequence) const {
    v1::CameraJob job;
    job.mutable_key()->set_reconstruction_id("a");
    job.mutable_key()->set_sequence(sequence);
    job.mutable_key()->set_epoch(1);
    job.set_camera(0);
    job.add_neighbours(1);
    job.add_targets(1);
    job.set_scene_digest(scene_digest_);
    return job;
  }
  static CameraJobResult Nothing(const CameraJobInput& input, const CameraJobOptions& options, ThreadPool&) {
    CameraJobResult result;
    result.filtered = PatchLattice::Empty(input.reference.camera_index, input.reference.camera, options.lattice_step);
    return result;
  }
  static bool Told(const v1::SynchronizeRequest& request, v1::HeldJob::OutcomeCase outcome) {
    return request.held_size() == 1 && request.held(0).outcome_case() == outcome;
  }
  v1::HeldJob WaitForOutcome(v1::HeldJob::OutcomeCase outcome) {
    const v1::SynchronizeRequest request =
        coordinator_.WaitFor([&](const v1::SynchronizeRequest& said) { return Told(said, outcome); });
    return request.held_size() == 1 ? request.held(0) : v1::HeldJob();
  }

  std::string folder_;
  std::unique_ptr<FilesystemBlobStore> blobs_;
  std::string scene_digest_;
  PlayedCoordinator coordinator_;
  ManualClock clock_;
  CameraRefiner refiner_;
  std::unique_ptr<Agent> agent_;
  std::thread thread_;
};

TEST_F(AgentTest, TellsAResultUntilTheCoordinatorHasTakenIt) {
  Start(Nothing);
  const v1::SynchronizeRequest first = coordinator_.WaitFor([](const auto&) { return true; });
  EXPECT_EQ(first.worker_id(), "w");
  EXPECT_FALSE(first.instance().empty());
  EXPECT_EQ(first.cores(), 2);
  EXPECT_FALSE(first.draining());
  EXPECT_EQ(first.held_size(), 0);

  coordinator_.Want({Job(1)});
  const v1::HeldJob done = WaitForOutcome(v1::HeldJob::kFinished);
  EXPECT_EQ(done.key().sequence(), 1);
  EXPECT_TRUE(*blobs_->Has(done.finished().filtered_digest()));
  // Answers may be lost: it is told again as long as the coordinator lists the job, then no more.
  coordinator_.Want({Job(1)});
  EXPECT_EQ(WaitForOutcome(v1::HeldJob::kFinished).finished().filtered_digest(), done.finished().filtered_digest());
  coordinator_.Want({});
  coordinator_.WaitFor([](const auto& said) { return said.held_size() == 0; });
}

TEST_F(AgentTest, RunsAJobOnceHoweverOftenItIsNamed) {
  std::atomic<int> runs = 0;
  Start([&](const CameraJobInput& input, const CameraJobOptions& options, ThreadPool& pool) {
    ++runs;
    return Nothing(input, options, pool);
  });
  for (int i = 0; i < 3; ++i) {
    coordinator_.Want({Job(1)});
    WaitForOutcome(v1::HeldJob::kFinished);
  }
  EXPECT_EQ(runs, 1);
}

TEST_F(AgentTest, RefinesCamerasAndTellsHowFarItIs) {
  std::atomic<bool> goes_on = false;
  refiner_ = [&](const Scene& scene, const std::string& options_json, BlobStore&, ThreadPool&,
                 const std::function<bool(double)>& progress) -> absl::StatusOr<CameraRefinement> {
    EXPECT_EQ(scene.views.size(), 2);
    EXPECT_EQ(options_json, "{}");
    while (!goes_on) {
      if (!progress(0.25)) return absl::CancelledError("stopped");
      absl::SleepFor(absl::Milliseconds(1));
    }
    return CameraRefinement{.cam_from_world = {Rigid3(), Rigid3()}, .tie_points = 7, .off_px = 0.5};
  };
  Start(Nothing);
  v1::CameraJob job = Job(1);
  job.set_refine_cameras(true);
  job.set_options_json("{}");
  coordinator_.Want({job});
  for (double told = 0; told != 0.25;) {
    coordinator_.Want({job});
    const v1::SynchronizeRequest said = coordinator_.WaitFor([](const auto& any) { return any.held_size() == 1; });
    ASSERT_EQ(said.held_size(), 1);
    told = said.held(0).running().fraction();
  }
  goes_on = true;
  const v1::HeldJob done = WaitForOutcome(v1::HeldJob::kFinished);
  const auto refinement = DecodeCameraRefinement(*blobs_->Get(done.finished().filtered_digest()));
  ASSERT_TRUE(refinement.ok()) << refinement.status();
  EXPECT_EQ(refinement->cam_from_world.size(), 2);
  // The row of the job need not hold all poses.
  const auto summary = DecodeCameraRefinement(done.finished().report_json());
  ASSERT_TRUE(summary.ok()) << summary.status();
  EXPECT_EQ(summary->off_px, 0.5);
  EXPECT_FALSE(summary->moved());
}

TEST_F(AgentTest, WhoRefinesNoCamerasSaysSoForGood) {
  Start(Nothing);
  v1::CameraJob job = Job(1);
  job.set_refine_cameras(true);
  coordinator_.Want({job});
  const v1::HeldJob failed = WaitForOutcome(v1::HeldJob::kFailed);
  EXPECT_TRUE(failed.failed().permanent());
  EXPECT_FALSE(failed.failed().infrastructure());
}

TEST_F(AgentTest, SaysWhenMemoryRanOut) {
  Start([](const CameraJobInput&, const CameraJobOptions&, ThreadPool&) -> CameraJobResult { throw std::bad_alloc(); });
  coordinator_.Want({Job(1)});
  const v1::HeldJob failed = WaitForOutcome(v1::HeldJob::kFailed);
  EXPECT_TRUE(failed.failed().out_of_memory());
  EXPECT_FALSE(failed.failed().infrastructure());
}

TEST_F(AgentTest, AJobThatCannotBeRightIsTheJobsFault) {
  Start(Nothing);
  v1::CameraJob job = Job(1);
  job.set_camera(2);
  coordinator_.Want({job});
  v1::HeldJob failed = WaitForOutcome(v1::HeldJob::kFailed);
  EXPECT_FALSE(failed.failed().infrastructure());
  EXPECT_THAT(failed.failed().reason(), HasSubstr("its cameras are not the scene's 2"));

  job = Job(2);
  job.set_options_json("{\"no\": 1}");
  coordinator_.Want({job});
  failed = WaitForOutcome(v1::HeldJob::kFailed);
  while (failed.key().sequence() == 1) failed = WaitForOutcome(v1::HeldJob::kFailed);
  EXPECT_FALSE(failed.failed().infrastructure());
  EXPECT_THAT(failed.failed().reason(), HasSubstr("no such option"));
}

TEST_F(AgentTest, AMissingBlobIsNamedAndOtherJobsAreLeftToOthersForAWhile) {
  Start(Nothing);
  v1::CameraJob job = Job(1);
  job.set_scene_digest(Sha256Hex("nobody has this"));
  coordinator_.Want({job});
  const v1::SynchronizeRequest request =
      coordinator_.WaitFor([](const v1::SynchronizeRequest& said) { return Told(said, v1::HeldJob::kFailed); });
  ASSERT_EQ(request.held_size(), 1);
  EXPECT_TRUE(request.held(0).failed().infrastructure());
  EXPECT_EQ(request.held(0).failed().damaged_blob(), job.scene_digest());
  EXPECT_TRUE(request.draining());
  // For at least half of the 2 s after a first failure, and no longer than all of them.
  coordinator_.Want({});
  clock_.Advance(absl::Seconds(0.9));
  const auto holds_nothing = [](const auto& said) { return said.held_size() == 0; };
  EXPECT_TRUE(coordinator_.WaitFor(holds_nothing).draining());
  clock_.Advance(absl::Seconds(1.1));
  coordinator_.WaitFor([](const auto& said) { return !said.draining(); });
}

TEST_F(AgentTest, GoesOnWhenTheCoordinatorAnswersAgain) {
  coordinator_.SetReachable(false);
  Start(Nothing);
  for (int i = 0; i < 2; ++i) coordinator_.WaitFor([](const auto&) { return true; });
  coordinator_.Want({Job(1)});
  coordinator_.SetReachable(true);
  WaitForOutcome(v1::HeldJob::kFinished);
}

// A job that runs until the test lets it end.
class HeldUpAgentTest : public AgentTest {
 protected:
  void StartHeldUp(absl::Duration drain) {
    Start(
        [this](const CameraJobInput& input, const CameraJobOptions& options, ThreadPool& pool) {
          std::unique_lock<std::mutex> lock(mutex_);
          changed_.wait(lock, [this] { return let_go_; });
          return Nothing(input, options, pool);
        },
        drain);
    coordinator_.Want({Job(1)});
    WaitForOutcome(v1::HeldJob::kRunning);
  }
  void LetGo() {
    const std::lock_guard<std::mutex> lock(mutex_);
    let_go_ = true;
    changed_.notify_all();
  }
  void TearDown() override {
    LetGo();
    AgentTest::TearDown();
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool let_go_ = false;
};

TEST_F(HeldUpAgentTest, AJobThatSomebodyElseHasCostsItsCoreUntilItEndsAndIsNotTold) {
  StartHeldUp(absl::Seconds(30));
  coordinator_.Want({});
  const v1::SynchronizeRequest dropped =
      coordinator_.WaitFor([](const v1::SynchronizeRequest& said) { return said.held_size() == 0; });
  EXPECT_EQ(dropped.cores(), 1);
  LetGo();
  // Its thread ends by itself; soon after the core is there again.
  v1::SynchronizeRequest said;
  for (const Stopwatch waited; said.cores() != 2 && waited.Elapsed() < absl::Seconds(20);) {
    coordinator_.Want({});
    said = coordinator_.WaitFor([](const auto&) { return true; });
    EXPECT_EQ(said.held_size(), 0);
  }
  EXPECT_EQ(said.cores(), 2);
}

TEST_F(AgentTest, AWorkerThatHoldsNothingForLongEnoughDrainsAndEnds) {
  Start(Nothing, absl::Seconds(30), absl::Seconds(100));
  EXPECT_FALSE(coordinator_.WaitFor([](const auto&) { return true; }).draining());
  clock_.Advance(absl::Seconds(99));
  coordinator_.Want({Job(1)});  // in time: the wait begins anew
  EXPECT_EQ(WaitForOutcome(v1::HeldJob::kFinished).key().sequence(), 1);
  clock_.Advance(absl::Seconds(99));
  coordinator_.Want({});
  EXPECT_FALSE(coordinator_.WaitFor([](const auto& said) { return said.held_size() == 0; }).draining());
  clock_.Advance(absl::Seconds(100));
  coordinator_.Want({});
  thread_.join();
}

TEST_F(HeldUpAgentTest, DrainingFinishesWhatRunsAndTakesNothingNew) {
  StartHeldUp(absl::Seconds(30));
  agent_->Drain();
  EXPECT_TRUE(coordinator_.WaitFor([](const auto& said) { return said.draining(); }).held(0).has_running());
  coordinator_.Want({Job(1), Job(2)});
  LetGo();
  const v1::HeldJob done = WaitForOutcome(v1::HeldJob::kFinished);
  EXPECT_EQ(done.key().sequence(), 1);
  coordinator_.Want({});
  thread_.join();
}

TEST_F(HeldUpAgentTest, AJobThatOutlastsTheDrainIsReleased) {
  StartHeldUp(absl::ZeroDuration());
  agent_->Drain();
  EXPECT_EQ(WaitForOutcome(v1::HeldJob::kReleased).key().sequence(), 1);
  coordinator_.Want({});
  thread_.join();  // although the job still runs
}

}  // namespace
}  // namespace meshwright
