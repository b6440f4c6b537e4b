#pragma once

#include <functional>
#include <string>

namespace meshwright {

enum class LocalStage { kChecking, kPairs, kCameras, kJudging, kJoining, kTexturing };
std::string NameOf(LocalStage stage);

// What a progress display can show.
struct LocalProgress {
  LocalStage stage = LocalStage::kChecking;
  int done = 0;  // photographs checked, cameras committed
  int total = 0;
  int resumed_from = 0;       // cameras that were committed before this process started
  double share_covered = 0;   // of the rays of the cameras processed so far: covered by accepted surfaces before,
  double share_grown = 0;     // grown,
  double share_accepted = 0;  // accepted
};
using ProgressListener = std::function<void(const LocalProgress&)>;  // one call at a time, from any thread

}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
