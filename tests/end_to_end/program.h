// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>
#include <sys/types.h>

#include "common/base/temporary_folder_testing.h"

namespace meshwright::end_to_end {

// How a run of the program ended.
struct RunResult {
  int exit_code = -1;  // -1: ended by a signal
  int signal = 0;
  double seconds = 0;
  std::string out;
  std::string err;
};

struct RunSettings {
  std::optional<double> kill_after_seconds;  // SIGKILL
  std::optional<int64_t> max_file_bytes;     // writes beyond fail, as on a full disk
};

// Runs the meshwright that was built, with these arguments, and waits for its end.
RunResult RunMeshwright(const std::vector<std::string>& arguments, const RunSettings& settings = {});

// The JSON that a run printed; discarded() when it printed none.
nlohmann::json JsonOf(const RunResult& result);

std::string ReadBytes(const std::string& path);
void WriteBytes(const std::string& path, const std::string& bytes);

// Names of all files and folders in a folder, sorted.
std::vector<std::string> ListFolder(const std::string& path);

// The scenes that tests share, made once a program: "small" (8 photographs of 480x360 of a facade), "turn" (24 of
// 400x300 around an object), "facade", "ring".
const std::string& SharedScene(const std::string& name);

}  // namespace meshwright::end_to_end
