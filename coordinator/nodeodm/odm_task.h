// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

namespace meshwright {

// The states of NodeODM.
enum class OdmStatus { kQueued = 10, kRunning = 20, kFailed = 30, kCompleted = 40, kCancelled = 50 };

// A task of NodeODM's protocol: a reconstruction, and what the protocol knows beside it.
struct OdmTask {
  std::string uuid;
  int run = 0;  // grows when it is restarted
  std::string name;
  std::string owner;  // the user whose key it was begun with; "": nobody's in particular
  nlohmann::ordered_json options = nlohmann::ordered_json::array();  // as they came
  std::vector<std::string> outputs;                                  // paths of all.zip that are wanted; none: all
  std::string webhook;
  bool is_committed = false;  // before, it is no task for anybody but its uploader
  int64_t created_ms = 0;     // since 1970
  int64_t begun_ms = 0;       // processing; 0: not yet
  int64_t ended_ms = 0;
  OdmStatus status = OdmStatus::kQueued;
  std::string error;
  double progress = 0;  // 0 .. 100, never falls
  int images = 0;
  int longest_side_px = 0;  // of all photographs
  int64_t parts_told = 0;   // sequence of the last part that the output tells of
  bool has_result = false;  // files of all.zip are there
  std::string stage_told;   // the last stage before the first camera that the output tells of; not kept in the file
};

// "dc1a4b08-....": lower case, 8-4-4-4-12.
bool IsUuid(const std::string& text);
std::string DrawUuid();

// What is said of a task that is not there, or of somebody else's.
absl::Status NoSuchTask();

// The reconstruction of its run: the first one is called like the task.
std::string ReconstructionOf(const OdmTask& task);

bool HasEnded(const OdmTask& task);

// For a file of one's own.
std::string EncodeTask(const OdmTask& task);
absl::StatusOr<OdmTask> DecodeTask(const std::string& text);

// The body of GET /task/UUID/info.
nlohmann::ordered_json DescribeTask(const OdmTask& task, int64_t now_ms);

}  // namespace meshwright
