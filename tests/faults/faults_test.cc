// SPDX-License-Identifier: Apache-2.0
// What may go wrong while a reconstruction runs. Each of these ends with the bytes that one undisturbed process makes.

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include <absl/strings/str_cat.h>
#include <absl/time/clock.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/base/clock.h"
#include "coordinator/store/postgres_testing.h"
#include "tests/faults/cut_line.h"
#include "tests/faults/faults_fixture.h"
#include "tests/faults/small_disk.h"

namespace meshwright::faults {
namespace {

namespace fs = std::filesystem;
using end_to_end::BackgroundProgram;
using end_to_end::ReadBytes;
using end_to_end::With;
using end_to_end::WriteBytes;

TEST_F(FaultsTest, AWorkerIsKilledTwentyTimes) {
  const auto coordinator = service_.StartCoordinator();
  std::vector<std::unique_ptr<BackgroundProgram>> workers;
  for (const char* id : {"first", "second"}) workers.push_back(service_.StartWorker(id));
  Submit();
  std::mt19937 random(20);
  int while_running = 0;
  for (int kill = 0; kill < 20; ++kill) {
    absl::SleepFor(absl::Milliseconds(200 + static_cast<int>(random() % 800)));
    const size_t victim = random() % workers.size();
    if (!IsOver()) ++while_running;
    workers[victim]->Stop(SIGKILL);
    workers[victim] = service_.StartWorker(victim == 0 ? "first" : "second");
  }
  EXPECT_GE(while_running, 5);
  EXPECT_TRUE(service_.WaitForMesh("turn") == Expected());
}

TEST_F(FaultsTest, TheCoordinatorIsKilledThreeTimes) {
  auto coordinator = service_.StartCoordinator();
  const auto first = service_.StartWorker("first");
  const auto second = service_.StartWorker("second");
  Submit();
  for (const int commits : {2, 8, 16}) {
    ASSERT_TRUE(Reaches(commits));
    coordinator->Stop(SIGKILL);
    coordinator = service_.StartCoordinator();  // on the same port: the workers find it again
  }
  EXPECT_TRUE(service_.WaitForMesh("turn") == Expected());
}

class PostgresFaultsTest : public FaultsTest {
 protected:
  void SetUp() override {
    auto started = PostgresServer::Start();
    if (!started.ok()) GTEST_SKIP() << started.status().message();
    postgres_ = *std::move(started);
  }
  std::vector<std::string> State() const {
    return {"--store", postgres_->url(), "--blobs", service_.folder() / "blobs"};
  }
  std::unique_ptr<PostgresServer> postgres_;
};

TEST_F(PostgresFaultsTest, TheConductorOfTwoCoordinatorsIsKilled) {
  // Each has a data folder of its own, as on two machines; the store and the blobs they share.
  auto conductor = service_.StartCoordinator(With(State(), {"--data", service_.folder() / "one"}));
  const std::string first_address = service_.address();
  Submit();
  const auto worker_of_first = service_.StartWorker("first");
  ASSERT_TRUE(Reaches(2));
  service_.ForgetPort();
  const auto other = service_.StartCoordinator(With(State(), {"--data", service_.folder() / "two"}));
  ASSERT_NE(service_.address(), first_address);
  const auto worker_of_other = service_.StartWorker("second");
  ASSERT_TRUE(Reaches(6));  // as the other one sees it
  conductor->Stop(SIGKILL);
  const Stopwatch since_kill;
  const int before = service_.Committed("turn");
  ASSERT_TRUE(Reaches(before + 1, 30));
  RecordProperty("seconds_until_the_next_commit", absl::StrCat(since_kill.Seconds()));
  EXPECT_TRUE(service_.WaitForMesh("turn") == Expected());
}

TEST_F(PostgresFaultsTest, PostgresIsRestartedAndThenAwayForFifteenSeconds) {
  const auto coordinator = service_.StartCoordinator(State());
  const auto first = service_.StartWorker("first");
  const auto second = service_.StartWorker("second");
  Submit();
  ASSERT_TRUE(Reaches(2));
  postgres_->Stop("fast");
  postgres_->StartAgain();
  ASSERT_TRUE(Reaches(6));
  postgres_->Stop("immediate");
  absl::SleepFor(absl::Seconds(15));
  postgres_->StartAgain();
  EXPECT_TRUE(service_.WaitForMesh("turn") == Expected());
}

TEST_F(FaultsTest, AWorkerIsCutOffForLongerThanALeaseAndComesBack) {
  const auto coordinator = service_.StartCoordinator();
  CutLine line(port());
  const auto cut_off = service_.StartWorker("cut-off", {}, line.address());
  Submit();
  ASSERT_TRUE(Reaches(2));
  line.Cut();
  absl::SleepFor(absl::Seconds(5));  // the lease is 2 s
  const auto other = service_.StartWorker("other");
  ASSERT_TRUE(Reaches(service_.Committed("turn") + 2));
  line.Mend();  // it brings results that somebody else has brought meanwhile
  EXPECT_TRUE(service_.WaitForMesh("turn") == Expected());
}

TEST_F(FaultsTest, AWorkerStopsForLongerThanALeaseAndGoesOn) {
  const auto coordinator = service_.StartCoordinator();
  const auto stopped = service_.StartWorker("stopped");
  Submit();
  ASSERT_TRUE(Reaches(1));
  stopped->Signal(SIGSTOP);
  const auto other = service_.StartWorker("other");
  ASSERT_TRUE(Reaches(service_.Committed("turn") + 3));
  stopped->Signal(SIGCONT);
  EXPECT_TRUE(service_.WaitForMesh("turn") == Expected());
}

// Flips one byte in the middle of every blob that begins with these bytes; returns how many there are.
int FlipBytes(const std::string& folder, const std::string& magic) {
  int flipped = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file()) continue;
    std::string bytes = ReadBytes(entry.path().string());
    if (bytes.compare(0, magic.size(), magic) != 0) continue;
    bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 0x10);
    fs::permissions(entry.path(), fs::perms::owner_write, fs::perm_options::add);
    WriteBytes(entry.path().string(), bytes);
    ++flipped;
  }
  return flipped;
}

TEST_F(FaultsTest, SurfacesRotOnTheDisk) {
  const auto coordinator = service_.StartCoordinator();
  auto worker = service_.StartWorker("worker");
  Submit();
  ASSERT_TRUE(Reaches(6));
  EXPECT_GT(FlipBytes(service_.folder() / "data/blobs", "MWSF"), 0);
  EXPECT_TRUE(service_.WaitForMesh("turn") == Expected());
}

TEST_F(FaultsTest, PhotographsRotOnTheDiskThoughTheSceneIsStillThere) {
  const fs::path folder = scene();
  const auto coordinator = service_.StartCoordinator({"--scene-root", folder.parent_path().string()});
  auto worker = service_.StartWorker("worker");
  const auto submitted = service_.Client(With({"submit", "file:turn", "--id", "turn"}, options_));
  ASSERT_EQ(submitted.exit_code, 0) << submitted.err;
  ASSERT_TRUE(Reaches(2));
  worker->Stop(SIGKILL);  // with the photographs that it had read
  EXPECT_EQ(FlipBytes(service_.folder() / "data/blobs", "\x89PNG"), 24);
  worker = service_.StartWorker("worker");
  EXPECT_TRUE(service_.WaitForMesh("turn") == Expected());
}

TEST_F(FaultsTest, UploadedPhotographsThatRotAreNamed) {
  const auto coordinator = service_.StartCoordinator();
  auto worker = service_.StartWorker("worker");
  Submit();
  ASSERT_TRUE(Reaches(2));
  worker->Stop(SIGKILL);
  EXPECT_EQ(FlipBytes(service_.folder() / "data/blobs", "\x89PNG"), 24);
  worker = service_.StartWorker("worker");
  EXPECT_EQ(service_.Client({"watch", "turn"}).exit_code, 1);
  EXPECT_THAT(service_.Status("turn")["failure"].get<std::string>(),
              testing::ContainsRegex("[0-9]+\\.png is damaged or lost"));
}

TEST_F(FaultsTest, TheCoordinatorsDiskIsFullForAWhile) {
  const SmallDisk disk(service_.folder() / "disk");
  if (!disk.mounted()) GTEST_SKIP() << "only root can mount a small file system";
  const auto coordinator = service_.StartCoordinator({"--data", disk.path() + "/data"});
  const auto worker = service_.StartWorker("worker");
  Submit();
  ASSERT_TRUE(Reaches(2));
  disk.Fill(8 << 10);
  absl::SleepFor(absl::Seconds(5));
  disk.Empty();
  EXPECT_TRUE(service_.WaitForMesh("turn") == Expected());
}

TEST_F(FaultsTest, AWorkersDiskIsFullForAWhile) {
  // Workers write surfaces into the blob folder when they share it.
  const SmallDisk disk(service_.folder() / "disk");
  if (!disk.mounted()) GTEST_SKIP() << "only root can mount a small file system";
  const std::string blobs = disk.path() + "/blobs";
  const auto coordinator = service_.StartCoordinator({"--blobs", blobs});
  const auto worker = service_.StartWorker("worker", {"--blobs", blobs});
  Submit();
  ASSERT_TRUE(Reaches(2));
  disk.Fill(8 << 10);
  absl::SleepFor(absl::Seconds(5));
  disk.Empty();
  EXPECT_TRUE(service_.WaitForMesh("turn") == Expected());
}

}  // namespace
}  // namespace meshwright::faults
