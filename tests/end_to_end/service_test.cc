// The service as real processes: a coordinator, two workers and the command line's client. What they make has the bytes
// that one process makes, also when a worker is killed.

#include <csignal>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include "tests/end_to_end/background_program.h"
#include "tests/end_to_end/program.h"

namespace meshwright::end_to_end {
namespace {

const std::vector<std::string> kQuickOptions = {"--max-image-size", "240"};

std::vector<std::string> With(std::vector<std::string> arguments, const std::vector<std::string>& more) {
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

class ServiceTest : public testing::Test {
 protected:
  void StartCoordinator() {
    const std::string log = folder_ / "coordinator.log";
    std::remove(log.c_str());
    coordinator_ = std::make_unique<BackgroundProgram>(
        MESHWRIGHT_COORDINATOR,
        std::vector<std::string>{"--data", folder_ / "data", "--listen", "127.0.0.1:" + port_, "--lease-seconds", "2"},
        log);
    port_ = ListeningPort(log);
  }
  std::unique_ptr<BackgroundProgram> StartWorker(const std::string& id) {
    return std::make_unique<BackgroundProgram>(
        MESHWRIGHT_WORKER,
        std::vector<std::string>{"--coordinator", "127.0.0.1:" + port_, "--worker-id", id, "--cores", "1"},
        folder_ / (id + ".log"));
  }
  RunResult Client(const std::vector<std::string>& arguments) const {
    return RunMeshwright(With(arguments, {"--coordinator", "127.0.0.1:" + port_, "--quiet"}));
  }
  nlohmann::json Status(const std::string& id) const { return JsonOf(Client({"status", id, "--json"})); }
  int Committed(const std::string& id) const {
    const nlohmann::json status = Status(id);
    return status.is_object() ? status["cameras"]["committed"].get<int>() : 0;
  }

  const TemporaryFolder folder_;
  std::string port_ = "0";
  std::unique_ptr<BackgroundProgram> coordinator_;
};

TEST_F(ServiceTest, SameBytesAsOneProcessThoughAWorkerIsKilled) {
  const std::string scene = SharedScene("small");
  const std::string local = folder_ / "local.ply";
  ASSERT_EQ(RunMeshwright(With({"reconstruct", scene, "-o", local, "--quiet"}, kQuickOptions)).exit_code, 0);

  StartCoordinator();
  auto first = StartWorker("first");
  const auto second = StartWorker("second");
  const RunResult submitted = Client(With({"submit", scene, "--id", "small"}, kQuickOptions));
  ASSERT_EQ(submitted.exit_code, 0) << submitted.err;
  EXPECT_EQ(submitted.out, "small\n");

  ASSERT_TRUE(WaitUntil([&] { return Committed("small") >= 1; }, 60));
  first->Stop(SIGKILL);
  first = StartWorker("first");
  const RunResult watched = Client({"watch", "small", "--json"});
  ASSERT_EQ(watched.exit_code, 0) << watched.err;
  const nlohmann::json report = JsonOf(watched);
  EXPECT_EQ(report["state"], "done");
  EXPECT_EQ(report["cameras"]["committed"], 8);
  EXPECT_EQ(report["cameras"]["set_aside"], 0);

  const std::string fetched = folder_ / "fetched.ply";
  ASSERT_EQ(Client({"fetch", "small", "-o", fetched}).exit_code, 0);
  EXPECT_TRUE(ReadBytes(fetched) == ReadBytes(local));

  // Asked to, a worker ends within its time and is missed by nobody.
  const int status = first->Stop(SIGTERM);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
  const int coordinator_status = coordinator_->Stop(SIGTERM);
  EXPECT_TRUE(WIFEXITED(coordinator_status) && WEXITSTATUS(coordinator_status) == 0);
}

TEST_F(ServiceTest, TheCoordinatorMayBeKilled) {
  const std::string scene = SharedScene("small");
  const std::string local = folder_ / "local.ply";
  ASSERT_EQ(RunMeshwright(With({"reconstruct", scene, "-o", local, "--quiet"}, kQuickOptions)).exit_code, 0);
  StartCoordinator();
  const auto worker = StartWorker("worker");
  ASSERT_EQ(Client(With({"submit", scene, "--id", "small"}, kQuickOptions)).exit_code, 0);
  ASSERT_TRUE(WaitUntil([&] { return Committed("small") >= 2; }, 60));
  coordinator_->Stop(SIGKILL);
  StartCoordinator();  // on the same port: the worker finds it again
  EXPECT_EQ(Client({"watch", "small"}).exit_code, 0);
  ASSERT_EQ(Client({"fetch", "small", "-o", folder_ / "fetched.ply"}).exit_code, 0);
  EXPECT_TRUE(ReadBytes(folder_ / "fetched.ply") == ReadBytes(local));
}

TEST_F(ServiceTest, ACoordinatorThatIsNotThereIsAFailureInOneLine) {
  const RunResult result = RunMeshwright({"status", "--coordinator", "127.0.0.1:1"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, testing::StartsWith("meshwright: "));
  EXPECT_EQ(result.out, "");
}

}  // namespace
}  // namespace meshwright::end_to_end
