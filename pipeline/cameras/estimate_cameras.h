// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "pipeline/cameras/colmap_output.h"
#include "pipeline/cameras/pair_selection.h"

#include "common/base/clock.h"

namespace meshwright {

// Estimates the cameras of photographs (structure from motion) by running COLMAP as a program; none of its code is
// linked. It is stopped and started at will: what a step has done is kept, and a run that was killed goes on.
struct CameraEstimationSettings {
  std::string photographs;   // a folder of them, and perhaps masks/
  std::string scene_folder;  // gets sparse/0/, sparse/1/ ... and images -> photographs; work and log are in colmap/
  std::string program = "colmap";
  int threads = 1;                     // no influence on the result
  std::optional<PairSelection> pairs;  // none: by ChoosePairs
  int max_features = 4096;             // of a photograph; matching takes time with their square
  int max_image_size = 3200;           // px of the longer side, for finding features
  bool restart = false;                // throw away what the folder holds of other photographs or settings
  std::function<bool()> stop;          // asked now and then; may be empty
  std::function<void(const std::string& line)> say;  // for people: what was chosen, what was left out; may be empty
};

struct CameraProgress {
  CameraStep step = CameraStep::kChecking;
  int done = 0;              // photographs, pairs, or blocks of pairs
  int total = 0;             // 0: not known yet
  double fraction = 0;       // of everything, in [0, 1], by usual shares of the steps
  double seconds_left = -1;  // of this step, from its own speed; < 0: not known yet
};
using CameraProgressListener = std::function<void(const CameraProgress&)>;

struct CameraEstimate {
  int photographs = 0;
  int registered = 0;  // with a camera now
  std::vector<std::string> registered_names;
  std::vector<std::string> notes;  // what should be photographed better, a line each
};

// The version of COLMAP that runs under this name. FailedPrecondition: not installed (the message names the package) or
// older than 3.6.
absl::StatusOr<std::string> FindColmap(const std::string& program);

// The result is a function of photographs, masks and settings: numbers are given by us, features are compared by us and
// exactly, RANSAC and bundle adjustment run on one thread from one seed. Errors: BadInput
// (too few photographs, none that decodes), FailedPrecondition (COLMAP is missing; the photographs give no cameras, and
// what to photograph better; the folder holds others'), Cancelled (stop), Internal (COLMAP broke down, with its own
// last words).
absl::StatusOr<CameraEstimate> EstimateCameras(const CameraEstimationSettings& settings, const Clock& clock,
                                               const CameraProgressListener& listener);

}  // namespace meshwright
