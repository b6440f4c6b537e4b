// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>

namespace meshwright {

enum class LocalStage { kChecking, kRefining, kPairs, kCameras, kJudging, kJoining, kTexturing, kReporting };
std::string NameOf(LocalStage stage);

// What a progress display can show.
struct LocalProgress {
  LocalStage stage = LocalStage::kChecking;
  int done = 0;  // photographs checked, thousandths of refining, cameras committed, surfaces judged again, thousandths
                 // of the mesh joined
  int total = 0;
  double seconds_left = -1;   // until the mesh is there, from the cameras on; -1: nothing can be said
  int resumed_from = 0;       // cameras that were committed before this process started
  double share_covered = 0;   // of the rays of the cameras processed so far: covered by accepted surfaces before,
  double share_grown = 0;     // grown,
  double share_accepted = 0;  // accepted
};
using ProgressListener = std::function<void(const LocalProgress&)>;  // one call at a time, from any thread

}  // namespace meshwright
