// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/status.h>
#include <nlohmann/json.hpp>

namespace meshwright {

// What scripts may rely on.
enum ExitCode : int {
  kExitDone = 0,
  kExitFailed = 1,    // the machine or the program: disk full, output not writable, nothing reconstructed
  kExitWrongUse = 2,  // the command line
  kExitBadInput = 3,  // the scene or a file that was to be read
};

// Results go to stdout, progress and errors to stderr.
struct OutputSettings {
  bool json = false;   // the result as one JSON object
  bool quiet = false;  // no progress
};

// "meshwright: <message>" on stderr, one line whatever the message holds. Returns the exit code of the error.
int Fail(const absl::Status& status);
// "meshwright: warning: <message>" on stderr, one line.
void Warn(const std::string& message);
int FailWrongUse(const std::string& message);

void PrintJson(const nlohmann::ordered_json& json);

// "1:05", "2:03:09".
std::string FormatDuration(double seconds);
// "512 MiB", "1.4 GiB".
std::string FormatBytes(double bytes);
// "1,234,567".
std::string FormatCount(int64_t count);

}  // namespace meshwright
