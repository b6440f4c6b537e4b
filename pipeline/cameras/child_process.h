// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

namespace meshwright {

// Path of a program that `name` means: itself when it has a slash, else searched in PATH. Empty: there is none.
std::string FindProgram(const std::string& name);

struct ChildExit {
  int code = 0;    // of exit(); meaningless when a signal ended it
  int signal = 0;  // that ended it; 0: none
  bool ok() const { return code == 0 && signal == 0; }
};

// Runs a program in a process group of its own and waits for its end. `on_line` gets each line of its stdout and
// stderr, cut to 4 KiB. When `stop()` becomes true, which is asked five times a second, the group gets SIGTERM and five
// seconds later SIGKILL, and the result is Cancelled. The program does not outlive the thread that calls, however that
// ends. NotFound: no such program.
absl::StatusOr<ChildExit> RunChild(const std::vector<std::string>& arguments,
                                   const std::function<void(const std::string& line)>& on_line,
                                   const std::function<bool()>& stop);

}  // namespace meshwright
