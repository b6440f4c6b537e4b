// SPDX-License-Identifier: Apache-2.0
#include "pipeline/cameras/child_process.h"

#include <csignal>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/time/clock.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "common/base/clock.h"

namespace meshwright {
namespace {

absl::StatusOr<ChildExit> RunShell(const std::string& script, std::vector<std::string>* lines,
                                   const std::function<bool()>& stop = nullptr) {
  return RunChild(
      {"sh", "-c", script}, [&](const std::string& line) { lines->push_back(line); }, stop);
}

bool IsAlive(pid_t pid) { return ::kill(pid, 0) == 0; }

// Orphans are reaped by whoever is init, which may take a moment.
bool EndsSoon(pid_t pid) {
  for (int i = 0; i < 500 && IsAlive(pid); ++i) absl::SleepFor(absl::Milliseconds(20));
  return !IsAlive(pid);
}

TEST(ChildProcess, LinesAndExitComeBack) {
  std::vector<std::string> lines;
  const auto exit = RunShell("echo out; echo error >&2; printf 'a\\rlast'; exit 7", &lines);
  ASSERT_TRUE(exit.ok());
  EXPECT_EQ(exit->code, 7);
  EXPECT_EQ(exit->signal, 0);
  EXPECT_THAT(lines, testing::ElementsAre("out", "error", "a", "last"));
}

TEST(ChildProcess, ASignalIsToldFromAnExitCode) {
  std::vector<std::string> lines;
  const auto exit = RunShell("kill -ABRT $$", &lines);
  ASSERT_TRUE(exit.ok());
  EXPECT_EQ(exit->signal, SIGABRT);
  EXPECT_FALSE(exit->ok());
}

TEST(ChildProcess, NoSuchProgramIsNotFound) {
  EXPECT_TRUE(absl::IsNotFound(RunChild(
                                   {"no-such-program-here"}, [](const std::string&) {}, nullptr)
                                   .status()));
}

TEST(ChildProcess, AnEndlessLineTakesNoEndlessMemory) {
  std::vector<std::string> lines;
  ASSERT_TRUE(RunShell("head -c 3000000 /dev/zero", &lines).ok());
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_EQ(lines[0].size(), 4096U);
}

TEST(ChildProcess, DoesNotWaitForAGrandchildThatHoldsThePipe) {
  std::vector<std::string> lines;
  const Stopwatch stopwatch;
  ASSERT_TRUE(RunShell("sleep 30 & echo $!", &lines).ok());
  EXPECT_LT(stopwatch.Seconds(), 20);
  ASSERT_EQ(lines.size(), 1U);
  ::kill(std::stoi(lines[0]), SIGKILL);
}

TEST(ChildProcess, StopEndsTheWholeGroupEvenWhenItIsDeaf) {
  std::vector<std::string> lines;
  const auto status = RunShell("trap '' TERM; sleep 1000 & echo $$; echo $!; while :; do sleep 1; done", &lines, [&] {
                        return lines.size() >= 2;
                      }).status();
  EXPECT_TRUE(absl::IsCancelled(status)) << status;
  ASSERT_GE(lines.size(), 2U);
  EXPECT_TRUE(EndsSoon(std::stoi(lines[0])));
  EXPECT_TRUE(EndsSoon(std::stoi(lines[1])));
}

TEST(ChildProcess, DiesWithItsParentWhateverKillsIt) {
  int ends[2];
  ASSERT_EQ(::pipe(ends), 0);
  const pid_t parent = ::fork();
  if (parent == 0) {
    static_cast<void>(RunChild(
        {"sh", "-c", "echo $$; exec sleep 1000"},
        [&](const std::string& line) { static_cast<void>(::write(ends[1], line.c_str(), line.size() + 1) == 0); },
        nullptr));
    ::_exit(0);
  }
  std::string text(32, '\0');
  ASSERT_GT(::read(ends[0], text.data(), text.size()), 0);
  const pid_t child = std::stoi(text);
  ASSERT_TRUE(IsAlive(child));
  ::kill(parent, SIGKILL);
  ::waitpid(parent, nullptr, 0);
  EXPECT_TRUE(EndsSoon(child));
}

}  // namespace
}  // namespace meshwright
