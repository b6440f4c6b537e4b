// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <string>
#include <thread>
#include <vector>

#include <sys/types.h>

#include "common/base/clock.h"

namespace meshwright::end_to_end {

// A program in the background, its output appended to a file; killed when it goes out of scope.
class BackgroundProgram {
 public:
  BackgroundProgram(const std::string& program, const std::vector<std::string>& arguments, const std::string& log);
  ~BackgroundProgram();
  BackgroundProgram(const BackgroundProgram&) = delete;
  BackgroundProgram& operator=(const BackgroundProgram&) = delete;

  pid_t id() const { return child_; }
  void Signal(int signal) const;
  // Sends the signal and waits for the end. The wait status; -1 when it ended before.
  int Stop(int signal);

 private:
  pid_t child_;
};

template <typename Condition>
bool WaitUntil(const Condition& condition, double seconds) {
  const Stopwatch stopwatch;
  while (!condition()) {
    if (stopwatch.Seconds() > seconds) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return true;
}

// Waits until a coordinator that logs to this file says on which port it listens, with these words; aborts after a
// minute.
std::string ListeningPort(const std::string& log, const std::string& said = "listening on port ");

}  // namespace meshwright::end_to_end
