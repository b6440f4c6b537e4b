// SPDX-License-Identifier: Apache-2.0
#include "worker/main/worker_keeper.h"

#include <csignal>
#include <cstdio>
#include <sstream>
#include <string>

#include <absl/strings/match.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "program/console.h"

#include "common/base/files.h"

namespace meshwright {
namespace {

// The kernel should take the child, which has the memory, and not its keeper.
constexpr char kOutOfMemoryScore[] = "500";

absl::StatusOr<int64_t> FindCount(const std::string& path, const std::string& name) {
  const absl::StatusOr<std::string> text = ReadFile(path);
  if (!text.ok()) return text.status();
  std::istringstream lines(*text);
  std::string word;
  std::string value;
  while (lines >> word >> value) {
    int64_t count = 0;
    if (word == name && absl::SimpleAtoi(value, &count)) return count;
  }
  return absl::NotFoundError(absl::StrCat(path, ": no ", name));
}

void BecomeChild(pid_t keeper) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != keeper) ::_exit(kExitFailed);  // it died before this line
  if (std::FILE* const score = std::fopen("/proc/self/oom_score_adj", "w"); score != nullptr) {
    std::fputs(kOutOfMemoryScore, score);
    std::fclose(score);
  }
}

// Until the child has ended; its wait status.
int WaitForChild(pid_t child, const sigset_t& signals) {
  while (true) {
    int status = 0;
    if (::waitpid(child, &status, WNOHANG) == child) return status;
    int signal = 0;
    sigwait(&signals, &signal);
    if (signal != SIGCHLD) ::kill(child, signal);
  }
}

}  // namespace

absl::StatusOr<int64_t> CountOutOfMemoryKills() {
  // "0::/system.slice/worker.service"; in a container mostly "0::/".
  if (const absl::StatusOr<std::string> groups = ReadFile("/proc/self/cgroup"); groups.ok()) {
    std::istringstream lines(*groups);
    for (std::string line; std::getline(lines, line);) {
      if (!absl::StartsWith(line, "0::")) continue;
      const auto count = FindCount(absl::StrCat("/sys/fs/cgroup", line.substr(3), "/memory.events"), "oom_kill");
      if (count.ok()) return count;
    }
  }
  return FindCount("/proc/vmstat", "oom_kill");
}

int KeepAlive(const std::function<int(bool ran_out_of_memory)>& work) {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int signal : {SIGINT, SIGTERM, SIGCHLD}) sigaddset(&signals, signal);
  sigset_t before;
  sigprocmask(SIG_BLOCK, &signals, &before);
  bool ran_out_of_memory = false;
  while (true) {
    const absl::StatusOr<int64_t> kills_before = CountOutOfMemoryKills();
    const pid_t keeper = ::getpid();
    const pid_t child = ::fork();
    if (child < 0) return work(ran_out_of_memory);  // without a keeper, then
    if (child == 0) {
      sigprocmask(SIG_SETMASK, &before, nullptr);
      BecomeChild(keeper);
      std::exit(work(ran_out_of_memory));
    }
    const int status = WaitForChild(child, signals);
    if (WIFEXITED(status)) return WEXITSTATUS(status);
    const absl::StatusOr<int64_t> kills = CountOutOfMemoryKills();
    const bool was_killed = WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL;
    ran_out_of_memory = was_killed && kills.ok() && kills_before.ok() && *kills > *kills_before;
    if (!ran_out_of_memory) return 128 + WTERMSIG(status);
    std::fputs("meshwright-worker: killed since memory ran out; started again\n", stderr);
  }
}

}  // namespace meshwright
