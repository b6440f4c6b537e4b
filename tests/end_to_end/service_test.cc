// SPDX-License-Identifier: Apache-2.0
// The service as real processes: a coordinator, two workers and the command line's client. What they make has the bytes
// that one process makes. What may go wrong meanwhile is in tests/faults.

#include <csignal>
#include <filesystem>
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

// images/ that is a link to a folder elsewhere, as people keep photographs on another disk.
TEST(ServiceTest, ALinkedFolderOfPhotographsIsRead) {
  namespace fs = std::filesystem;
  RunningService service;
  const fs::path scene = service.folder() / "scene";
  fs::create_directories(scene);
  fs::copy(SharedScene("small") + "/model", scene / "model");
  fs::copy(SharedScene("small") + "/images", service.folder() / "pictures");
  fs::create_directory_symlink("../pictures", scene / "images");
  const std::string expected = service.LocalMesh(SharedScene("small"), kQuickOptions);
  EXPECT_TRUE(service.LocalMesh(scene, kQuickOptions) == expected);
  const auto coordinator = service.StartCoordinator();
  const auto worker = service.StartWorker("w");
  const RunResult submitted = service.Client(With({"submit", scene, "--id", "linked"}, kQuickOptions));
  ASSERT_EQ(submitted.exit_code, 0) << submitted.err;
  EXPECT_TRUE(service.WaitForMesh("linked") == expected);
}

TEST(ServiceTest, TheSurfacesSoFarCanBeFetched) {
  RunningService service;
  const auto coordinator = service.StartCoordinator();
  ASSERT_EQ(service.Client(With({"submit", SharedScene("turn"), "--id", "turn"}, kQuickOptions)).exit_code, 0);
  const std::string path = service.folder() / "early.ply";
  const RunResult none = service.Client({"fetch", "turn", "-o", path, "--partial"});
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_THAT(none.err, testing::HasSubstr("no surface is accepted yet"));
  {
    const auto worker = service.StartWorker("first");
    ASSERT_TRUE(WaitUntil([&] { return service.Committed("turn") >= 3; }, 120));
  }
  const RunResult whole = service.Client({"fetch", "turn", "-o", path});
  EXPECT_EQ(whole.exit_code, 1);
  EXPECT_THAT(whole.err, testing::HasSubstr("has no mesh; --partial"));
  EXPECT_THAT(whole.err, testing::Not(testing::HasSubstr("RECONSTRUCTION_STATE")));
  const RunResult early = service.Client({"fetch", "turn", "-o", path, "--partial"});
  ASSERT_EQ(early.exit_code, 0) << early.err;
  EXPECT_THAT(ReadBytes(path), testing::StartsWith("ply\n"));
  EXPECT_GT(ReadBytes(path).size(), 10'000U);
}

TEST(ServiceTest, EverybodyShowsAKey) {
  RunningService service;
  const std::string root = service.folder() / "root.key";
  const std::string join = service.folder() / "join.key";
  WriteBytes(root, "the-operators-key-0123456789\n");
  WriteBytes(join, "the-workers-key-0123456789\n");
  const auto coordinator = service.StartCoordinator({"--api-token-file", root, "--worker-token-file", join});
  const auto key_of = [&](const std::string& user) {
    const RunResult made = service.Client({"token", "create", "--user", user, "--expires", "1d", "--token-file", root});
    EXPECT_EQ(made.exit_code, 0) << made.err;
    const std::string path = service.folder() / (user + ".key");
    WriteBytes(path, made.out);
    return path;
  };
  const std::string alice = key_of("alice");
  const std::string bob = key_of("bob");
  EXPECT_THAT(service.Client({"status"}).err, testing::HasSubstr("a valid key is missing"));
  const auto worker = service.StartWorker("w", {"--token-file", join});
  const RunResult submitted = service.Client(
      With({"submit", SharedScene("small"), "--id", "small", "--wait", "--token-file", alice}, kQuickOptions));
  EXPECT_EQ(submitted.exit_code, 0) << submitted.err;
  EXPECT_THAT(service.Client({"status", "small", "--token-file", bob}).err, testing::HasSubstr("no reconstruction"));
  const nlohmann::json all = JsonOf(service.Client({"token", "list", "--json", "--token-file", root}));
  ASSERT_EQ(all["keys"].size(), 2U);
  EXPECT_EQ(all["keys"][0]["user"], "alice");
  EXPECT_EQ(all["keys"][0]["role"], "submitter");
  const std::string id = all["keys"][0]["id"];
  EXPECT_EQ(service.Client({"token", "revoke", id, "--token-file", root}).exit_code, 0);
  EXPECT_THAT(service.Client({"status", "small", "--token-file", alice}).err,
              testing::HasSubstr("a valid key is missing"));
  EXPECT_EQ(service.Client({"token", "create", "--user", "a", "--expires", "soon", "--token-file", root}).exit_code, 2);
}

TEST(ServiceTest, WhoWaitsGoesOnWhenTheCoordinatorIsRestarted) {
  RunningService service;
  auto coordinator = service.StartCoordinator();
  const std::string log = service.folder() / "waiting.log";
  const std::string mesh = service.folder() / "waited.ply";
  const BackgroundProgram waiting(
      MESHWRIGHT_PROGRAM,
      With({"submit", SharedScene("small"), "--id", "waited", "-o", mesh, "--coordinator", service.address()},
           kQuickOptions),
      log);
  ASSERT_TRUE(WaitUntil([&] { return ReadBytes(log).find("waiting for a worker") != std::string::npos; }, 60))
      << ReadBytes(log);
  coordinator->Stop(SIGKILL);
  ASSERT_TRUE(WaitUntil([&] { return ReadBytes(log).find("waiting for it") != std::string::npos; }, 30))
      << ReadBytes(log);
  coordinator = service.StartCoordinator();
  const auto worker = service.StartWorker("first");
  EXPECT_TRUE(service.WaitForMesh("waited") == service.LocalMesh(SharedScene("small"), kQuickOptions));
  EXPECT_TRUE(WaitUntil([&] { return ReadBytes(mesh).size() > 10'000; }, 30)) << ReadBytes(log);
}

TEST(ServiceTest, AnIdThatWasUsedStandsForItsScene) {
  RunningService service;
  const auto coordinator = service.StartCoordinator();
  const auto submit = [&](const std::string& scene) {
    return service.Client(With({"submit", scene, "--id", "one"}, kQuickOptions));
  };
  ASSERT_EQ(submit(SharedScene("small")).exit_code, 0);
  EXPECT_EQ(submit(SharedScene("small")).exit_code, 0) << "the same again";
  const RunResult other = submit(SharedScene("turn"));
  EXPECT_EQ(other.exit_code, 1);
  EXPECT_THAT(other.err, testing::HasSubstr("one was submitted with another scene"));
  const RunResult options = service.Client({"submit", SharedScene("small"), "--id", "one", "--window", "1"});
  EXPECT_EQ(options.exit_code, 1);
  EXPECT_THAT(options.err, testing::HasSubstr("another reconstruction"));
}

TEST(ServiceTest, ACoordinatorThatIsNotThereIsAFailureInOneLine) {
  const RunResult result = RunMeshwright({"status", "--coordinator", "127.0.0.1:1"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, testing::StartsWith("meshwright: no coordinator answers at 127.0.0.1:1; \"meshwright up\""));
  EXPECT_EQ(result.out, "");
}

}  // namespace
}  // namespace meshwright::end_to_end
