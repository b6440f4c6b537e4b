// SPDX-License-Identifier: Apache-2.0
#include "pipeline/cameras/child_process.h"

#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>
#include <absl/time/clock.h>
#include <absl/time/time.h>
#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "common/base/clock.h"

namespace meshwright {
namespace {

constexpr int kPollMs = 200;
constexpr size_t kLongestLine = 4096;  // bytes
const absl::Duration kTermGrace = absl::Seconds(5);

// Between fork and exec of a program with threads: only calls that are safe in a signal handler.
[[noreturn]] void BecomeProgram(const std::string& path, char* const* arguments, int output, pid_t parent) {
  ::setpgid(0, 0);
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(127);  // it died before this line
  sigset_t none;
  sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
  ::dup2(output, STDOUT_FILENO);
  ::dup2(output, STDERR_FILENO);
  const int nothing = ::open("/dev/null", O_RDONLY);
  if (nothing >= 0) ::dup2(nothing, STDIN_FILENO);
  ::execv(path.c_str(), arguments);
  ::_exit(127);
}

class Child {
 public:
  Child(pid_t pid, int output) : pid_(pid), output_(output) { ::fcntl(output_, F_SETFL, O_NONBLOCK); }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;
  ~Child() { ::close(output_); }

  absl::StatusOr<ChildExit> Run(const std::function<void(const std::string& line)>& on_line,
                                const std::function<bool()>& stop) {
    while (true) {
      pollfd readable{.fd = output_, .events = POLLIN, .revents = 0};
      const bool waited_in_vain = ::poll(&readable, 1, kPollMs) == 0;
      if (stop && stop()) {
        EndGroup(on_line);
        return absl::CancelledError("stopped");
      }
      const bool at_end = !ReadLines(on_line);
      // A grandchild may hold the pipe open after the child has ended.
      if ((at_end || waited_in_vain) && HasEnded(at_end)) break;
    }
    ReadLines(on_line);
    if (!line_.empty()) on_line(line_);
    return exit_;
  }

 private:
  // False at the end of the output.
  bool ReadLines(const std::function<void(const std::string& line)>& on_line) {
    std::array<char, 1 << 16> buffer;
    const ssize_t size = ::read(output_, buffer.data(), buffer.size());
    if (size < 0) return errno == EAGAIN || errno == EINTR;
    for (ssize_t i = 0; i < size; ++i) {
      const char c = buffer[static_cast<size_t>(i)];
      if (c == '\n' || c == '\r') {
        on_line(line_);
        line_.clear();
      } else if (line_.size() < kLongestLine) {
        line_.push_back(c);
      }
    }
    return size > 0;
  }

  bool HasEnded(bool wait) {
    if (ended_) return true;
    int status = 0;
    if (::waitpid(pid_, &status, wait ? 0 : WNOHANG) != pid_) return false;
    ended_ = true;
    exit_ = {.code = WIFEXITED(status) ? WEXITSTATUS(status) : 0, .signal = WIFSIGNALED(status) ? WTERMSIG(status) : 0};
    return true;
  }

  void EndGroup(const std::function<void(const std::string& line)>& on_line) {
    ::kill(-pid_, SIGTERM);
    const Stopwatch since_term;
    while (!HasEnded(false) && since_term.Elapsed() < kTermGrace) {
      ReadLines(on_line);
      absl::SleepFor(absl::Milliseconds(20));
    }
    ::kill(-pid_, SIGKILL);  // whatever of the group is left
    HasEnded(true);
  }

  const pid_t pid_;
  const int output_;
  std::string line_;
  bool ended_ = false;
  ChildExit exit_;
};

}  // namespace

std::string FindProgram(const std::string& name) {
  const auto is_program = [](const std::string& path) { return ::access(path.c_str(), X_OK) == 0; };
  if (name.find('/') != std::string::npos) return is_program(name) ? name : "";
  const char* path = std::getenv("PATH");
  for (const auto folder : absl::StrSplit(path == nullptr ? "/usr/local/bin:/usr/bin:/bin" : path, ':')) {
    const std::string candidate = absl::StrCat(folder, "/", name);
    if (!folder.empty() && is_program(candidate)) return candidate;
  }
  return "";
}

absl::StatusOr<ChildExit> RunChild(const std::vector<std::string>& arguments,
                                   const std::function<void(const std::string& line)>& on_line,
                                   const std::function<bool()>& stop) {
  const std::string path = FindProgram(arguments.front());
  if (path.empty()) return absl::NotFoundError(absl::StrCat(arguments.front(), ": no such program"));
  std::vector<std::string> copies = arguments;
  std::vector<char*> pointers;
  for (std::string& copy : copies) pointers.push_back(copy.data());
  pointers.push_back(nullptr);
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) {
    return absl::ResourceExhaustedError(absl::StrCat(path, ": no pipe: ", std::strerror(errno)));
  }
  const pid_t parent = ::getpid();
  const pid_t pid = ::fork();
  if (pid == 0) BecomeProgram(path, pointers.data(), ends[1], parent);
  ::close(ends[1]);
  if (pid < 0) {
    ::close(ends[0]);
    return absl::ResourceExhaustedError(absl::StrCat(path, ": cannot be started: ", std::strerror(errno)));
  }
  ::setpgid(pid, pid);  // the child does it too: whoever comes first
  return Child(pid, ends[0]).Run(on_line, stop);
}

}  // namespace meshwright
