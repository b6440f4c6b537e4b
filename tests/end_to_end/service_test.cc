// The service as real processes: a coordinator, two workers and the command line's client. What they make has the bytes
// that one process makes. What may go wrong meanwhile is in tests/faults.

#include <csignal>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include "tests/end_to_end/program.h"
#include "tests/end_to_end/running_service.h"

namespace meshwright::end_to_end {
namespace {

const std::vector<std::string> kQuickOptions = {"--max-image-size", "240"};

TEST(ServiceTest, SameBytesAsOneProcess) {
  const std::string scene = SharedScene("small");
  RunningService service;
  const auto coordinator = service.StartCoordinator();
  const auto first = service.StartWorker("first");
  const auto second = service.StartWorker("second");
  const RunResult submitted = service.Client(With({"submit", scene, "--id", "small"}, kQuickOptions));
  ASSERT_EQ(submitted.exit_code, 0) << submitted.err;
  EXPECT_EQ(submitted.out, "small\n");
  EXPECT_TRUE(service.WaitForMesh("small") == service.LocalMesh(scene, kQuickOptions));
  EXPECT_EQ(service.Status("small")["cameras"]["committed"], 8);

  // Asked to, a worker ends within its time and is missed by nobody.
  const int status = first->Stop(SIGTERM);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
  const int coordinator_status = coordinator->Stop(SIGTERM);
  EXPECT_TRUE(WIFEXITED(coordinator_status) && WEXITSTATUS(coordinator_status) == 0);
}

TEST(ServiceTest, ACoordinatorThatIsNotThereIsAFailureInOneLine) {
  const RunResult result = RunMeshwright({"status", "--coordinator", "127.0.0.1:1"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, testing::StartsWith("meshwright: "));
  EXPECT_EQ(result.out, "");
}

}  // namespace
}  // namespace meshwright::end_to_end
