// SPDX-License-Identifier: Apache-2.0
// Clocks that are set an hour forward or back while a reconstruction runs: of the coordinator, of a worker, of the
// database. Each of these ends with the bytes that one undisturbed process makes, and hardly later.

#include <csignal>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include <gmock/gmock.h>

#include "coordinator/store/postgres_testing.h"
#include "tests/faults/faults_fixture.h"

namespace meshwright::faults {
namespace {

namespace fs = std::filesystem;
using end_to_end::BackgroundProgram;
using end_to_end::With;

constexpr char kFaketime[] = "/usr/lib/x86_64-linux-gnu/faketime/libfaketimeMT.so.1";

// The wall clock of the programs that are started within: elapsed time goes on as it does, as on a machine whose clock
// is set.
class SettableClock {
 public:
  SettableClock() {
    std::string pattern = testing::TempDir() + "clock_XXXXXX";
    folder_ = ::mkdtemp(pattern.data());
    fs::permissions(folder_, fs::perms::owner_all | fs::perms::group_read | fs::perms::group_exec |
                                 fs::perms::others_read | fs::perms::others_exec);  // PostgreSQL runs as another user
    Set("+0");
  }
  ~SettableClock() { fs::remove_all(folder_); }
  SettableClock(const SettableClock&) = delete;
  SettableClock& operator=(const SettableClock&) = delete;

  static bool IsThere() { return fs::exists(kFaketime); }
  // "+1h"
  void Set(const std::string& offset) const {
    end_to_end::WriteBytes(folder_ + "/next", offset + "\n");
    fs::rename(folder_ + "/next", folder_ + "/offset");
  }
  std::unique_ptr<Environment> Use() const {
    return std::make_unique<Environment>(
        std::vector<std::pair<std::string, std::string>>{{"LD_PRELOAD", kFaketime},
                                                         {"FAKETIME_TIMESTAMP_FILE", folder_ + "/offset"},
                                                         {"FAKETIME_CACHE_DURATION", "1"},
                                                         {"FAKETIME_DONT_FAKE_MONOTONIC", "1"},
                                                         {"DONT_FAKE_MONOTONIC", "1"}});
  }

 private:
  std::string folder_;
};

class ClockFaultsTest : public FaultsTest {
 protected:
  void SetUp() override {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "sanitizers and libfaketime want to be loaded first, both";
#endif
    if (!SettableClock::IsThere()) GTEST_SKIP() << "libfaketime is not installed (apt-get install faketime)";
    options_ = {"--lattice-step", "2"};
  }

  // Sets the clock forward, back, and to what it was; a worker dies when it has been set back.
  void RunWhileItIsSet() {
    Submit();
    auto first = service_.StartWorker("first");
    ASSERT_TRUE(Reaches(2));
    clock_.Set("+1h");
    ASSERT_TRUE(Reaches(6, 60));
    clock_.Set("-1h");
    ASSERT_TRUE(Reaches(10, 60));
    // Its job is given to the other one when its lease of 2 s is over, not an hour later.
    first->Stop(SIGKILL);
    const auto third = service_.StartWorker("third");
    ASSERT_TRUE(Reaches(14, 60));
    clock_.Set("+0");
    EXPECT_TRUE(service_.WaitForMesh("turn") == Expected());
  }

  SettableClock clock_;
};

TEST_F(ClockFaultsTest, TheCoordinatorsIsSet) {
  auto clock = clock_.Use();
  auto coordinator = service_.StartCoordinator();
  clock.reset();
  const auto second = service_.StartWorker("second");
  RunWhileItIsSet();
}

TEST_F(ClockFaultsTest, AWorkersIsSet) {
  const auto coordinator = service_.StartCoordinator();
  auto clock = clock_.Use();
  const auto second = service_.StartWorker("second");
  clock.reset();
  RunWhileItIsSet();
}

TEST_F(ClockFaultsTest, TheDatabasesIsSet) {
  auto clock = clock_.Use();
  auto postgres = PostgresServer::Start();
  clock.reset();
  if (!postgres.ok()) GTEST_SKIP() << postgres.status().message();
  const std::string before = RunSql((*postgres)->url(), "SELECT now() > '2001-01-01'");
  ASSERT_EQ(before, "t");
  const auto coordinator =
      service_.StartCoordinator({"--store", (*postgres)->url(), "--blobs", service_.folder() / "blobs"});
  const auto second = service_.StartWorker("second");
  RunWhileItIsSet();
  // It was really set, by an hour forward and back: the times that the store has noted are far apart.
  EXPECT_GT(std::stod(RunSql((*postgres)->url(), "SELECT max(leased_at) - min(leased_at) FROM camera_jobs")), 3000e6);
}

}  // namespace
}  // namespace meshwright::faults
