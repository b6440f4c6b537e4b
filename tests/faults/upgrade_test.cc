// SPDX-License-Identifier: Apache-2.0
// Old and new programs side by side while a reconstruction runs: through a rolling upgrade and back.

#include <csignal>
#include <memory>
#include <string>

#include <absl/strings/str_cat.h>
#include <absl/time/clock.h>
#include <gmock/gmock.h>

#include "common/base/method_version.h"
#include "tests/faults/faults_fixture.h"

namespace meshwright::faults {
namespace {

using end_to_end::BackgroundProgram;
using end_to_end::WaitUntil;

class UpgradeTest : public FaultsTest {
 protected:
  void SetUp() override { options_ = {"--lattice-step", "2"}; }

  // `method`: that the next version has.
  std::unique_ptr<BackgroundProgram> StartNextCoordinator(int method) {
    const Environment environment({{"NEXT_METHOD_VERSION", absl::StrCat(method)}});
    return service_.StartCoordinator({}, NEXT_COORDINATOR);
  }
  std::unique_ptr<BackgroundProgram> StartNextWorker(const std::string& id, int method) const {
    const Environment environment({{"NEXT_METHOD_VERSION", absl::StrCat(method)}});
    return service_.StartWorker(id, {}, "", NEXT_WORKER);
  }
  std::string Warnings() const {
    const nlohmann::json status = service_.Status("turn");
    return status.is_object() ? status.value("warnings", nlohmann::json::array()).dump() : "";
  }
};

TEST_F(UpgradeTest, ProgramsAreReplacedOneByOneAndBackAgain) {
  auto coordinator = service_.StartCoordinator();
  auto first = service_.StartWorker("first");
  auto second = service_.StartWorker("second");
  Submit();
  ASSERT_TRUE(Reaches(2));
  first->Stop(SIGTERM);
  first = StartNextWorker("first", kMethodVersion);
  ASSERT_TRUE(Reaches(5));
  coordinator->Stop(SIGTERM);
  coordinator = StartNextCoordinator(kMethodVersion);
  ASSERT_TRUE(Reaches(9));
  second->Stop(SIGTERM);
  second = StartNextWorker("second", kMethodVersion);
  ASSERT_TRUE(Reaches(13));
  const std::string workers = service_.Client({"workers", "--json"}).out;
  EXPECT_THAT(workers, testing::HasSubstr("99.0.0"));
  // The new version is not liked.
  coordinator->Stop(SIGTERM);
  coordinator = service_.StartCoordinator();
  ASSERT_TRUE(Reaches(16));
  first->Stop(SIGTERM);
  first = service_.StartWorker("first");
  EXPECT_TRUE(service_.WaitForMesh("turn") == Expected());
}

TEST_F(UpgradeTest, AnotherMethodWaitsForItsOwnProgramsAndCostsNoCamera) {
  auto coordinator = service_.StartCoordinator();
  auto worker = service_.StartWorker("old");
  Submit();
  ASSERT_TRUE(Reaches(2));
  // A worker of another method gets nothing, and who waits for whom is said.
  worker->Stop(SIGTERM);
  const auto next_worker = StartNextWorker("next", kMethodVersion + 1);
  const std::string wanted = absl::StrCat("version ", kMethodVersion, " of the method");
  EXPECT_TRUE(WaitUntil([&] { return Warnings().find(wanted) != std::string::npos; }, 60)) << Warnings();
  const int committed = service_.Committed("turn");
  // Nor does a coordinator of another one carry it on, or end it.
  coordinator->Stop(SIGTERM);
  coordinator = StartNextCoordinator(kMethodVersion + 1);
  worker = service_.StartWorker("old");
  EXPECT_TRUE(WaitUntil([&] { return Warnings().find(wanted) != std::string::npos; }, 60)) << Warnings();
  absl::SleepFor(absl::Seconds(2));
  EXPECT_LE(service_.Committed("turn"), committed + 4);  // no more than the window that was given out before
  EXPECT_EQ(service_.Status("turn")["state"], "running");
  coordinator->Stop(SIGTERM);
  coordinator = service_.StartCoordinator();
  EXPECT_TRUE(service_.WaitForMesh("turn") == Expected());
}

}  // namespace
}  // namespace meshwright::faults
