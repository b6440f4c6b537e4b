// SPDX-License-Identifier: Apache-2.0
// Settings of the real programs: none is passed over in silence, and --check says whether they are good.

#include <array>
#include <cstdio>
#include <regex>
#include <set>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include "tests/end_to_end/program.h"

namespace meshwright::end_to_end {
namespace {

using testing::HasSubstr;

struct Answer {
  int exit_code = -1;
  std::string said;  // on both channels
};

// `command` as a shell takes it.
Answer Ask(const std::string& command) {
  Answer answer;
  std::FILE* const pipe = ::popen((command + " 2>&1").c_str(), "r");
  std::array<char, 4096> buffer{};
  while (const size_t read = std::fread(buffer.data(), 1, buffer.size(), pipe)) answer.said.append(buffer.data(), read);
  const int status = ::pclose(pipe);
  answer.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return answer;
}

const std::string kCoordinator = MESHWRIGHT_COORDINATOR;
const std::string kWorker = MESHWRIGHT_WORKER;

std::set<std::string> VariablesIn(const std::string& text) {
  const std::regex variable("MESHWRIGHT_[A-Z_]+");
  return {std::sregex_token_iterator(text.begin(), text.end(), variable), std::sregex_token_iterator()};
}

TEST(ConfigurationTest, CheckAcceptsTheDefaults) {
  EXPECT_EQ(Ask(kWorker + " --check").exit_code, 0);
  const TemporaryFolder folder;
  const Answer answer = Ask(kCoordinator + " --check --data " + (folder / "data"));
  EXPECT_EQ(answer.exit_code, 0) << answer.said;
  EXPECT_TRUE(ListFolder(folder.path()).empty()) << "--check made something";
}

TEST(ConfigurationTest, TheFilesThatArePackagedAreGood) {
  const Answer coordinator = Ask(kCoordinator + " --check --config deploy/systemd/coordinator.conf");
  EXPECT_EQ(coordinator.exit_code, 0) << coordinator.said;
  const Answer worker = Ask(kWorker + " --check --config deploy/systemd/worker.conf");
  EXPECT_EQ(worker.exit_code, 0) << worker.said;
}

TEST(ConfigurationTest, WrongValuesAreNamedAndNothingIsStarted) {
  const TemporaryFolder folder;
  WriteBytes(folder / "short-token", "secret");
  const std::string start = kCoordinator + " --data " + (folder / "data") + " ";
  const std::vector<std::pair<std::string, std::string>> wrong = {
      {start + "--listen 7420", "--listen is \"7420\", expected host:port"},
      {start + "--rest-listen localhost", "--rest-listen is \"localhost\""},
      {start + "--metrics-listen :1", "--metrics-listen is \":1\""},
      {start + "--store mysql://x", "--store: expected sqlite:PATH or postgresql://"},
      {start + "--blobs ftp://x", "--blobs is ftp://x"},
      {start + "--scene-root /nowhere", "--scene-root is /nowhere"},
      {start + "--dashboard /tmp", "--dashboard is /tmp"},
      {start + "--api-token-file " + (folder / "short-token"), "whose token has 6 characters"},
      {start + "--api-token-file /nowhere/token", "/nowhere/token"},
      {start + "--api-token-fiel x", "did you mean --api-token-file?"},
      {start + "--lease-seconds 0", "--lease-seconds"},
      {"MESHWRIGHT_API_TOKEN_FIEL=x " + start, "did you mean MESHWRIGHT_API_TOKEN_FILE?"},
      {kCoordinator, "--data is required"},
      {kWorker + " --coordinator 7420", "--coordinator is \"7420\""},
      {kWorker + " --coordinator host:0", "port 0"},
      {kWorker + " --blobs s3://", "--blobs is s3://"},
      {"MESHWRIGHT_CORES=0 " + kWorker, "(in MESHWRIGHT_CORES)"},
  };
  for (const auto& [command, said] : wrong) {
    for (const char* check : {"", " --check"}) {
      const Answer answer = Ask(command + check);
      EXPECT_EQ(answer.exit_code, 2) << command;
      EXPECT_THAT(answer.said, testing::AllOf(testing::StartsWith("meshwright: "), HasSubstr(said))) << command;
    }
  }
  EXPECT_EQ(ListFolder(folder.path()).size(), 1U);
}

TEST(ConfigurationTest, TheCommandLineLooksAtTheEnvironmentToo) {
  const Answer answer = Ask(std::string("MESHWRIGHT_COORDINATR=x ") + MESHWRIGHT_PROGRAM + " options");
  EXPECT_EQ(answer.exit_code, 2);
  EXPECT_THAT(answer.said, HasSubstr("did you mean MESHWRIGHT_COORDINATOR?"));
}

// Machines often have one environment for several programs, and one shell for the compose file and them.
TEST(ConfigurationTest, EveryProgramKnowsTheNamesOfTheOthers) {
  const TemporaryFolder folder;
  std::set<std::string> all = VariablesIn(ReadBytes("docker-compose.yml"));
  for (const std::string& program : {kCoordinator, kWorker, std::string(MESHWRIGHT_PROGRAM) + " up"}) {
    all.merge(VariablesIn(Ask(program + " --help").said));
  }
  EXPECT_GT(all.size(), 15U);
  std::string environment;
  for (const std::string& variable : all) environment += variable + "=1 ";
  const Answer answer = Ask(environment + MESHWRIGHT_PROGRAM + " options --markdown");
  EXPECT_EQ(answer.exit_code, 0) << answer.said;
}

}  // namespace
}  // namespace meshwright::end_to_end
