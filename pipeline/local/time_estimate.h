// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

#include "pipeline/options/reconstruction_options.h"

#include "common/scene/scene.h"

namespace meshwright {

// What a reconstruction will presumably take, said before it begins.
struct TimeEstimate {
  double cpu_seconds = 0;
  double wall_seconds = 0;  // with the threads, on a machine that does nothing else
  int threads = 1;
  int cameras = 0;                  // that will be processed
  std::vector<std::string> tried;   // names of the cameras that were tried
  int tried_lattice_step = 0;       // px, at least that of the options
  double tried_cpu_seconds = 0;     // what trying took
  double expected_share_grown = 0;  // of the rays of all cameras
};

// Tries one or two cameras of the scene with the options, on a coarser lattice where theirs has many rays: what
// photographs, seeds and a ray take on this machine, and how many of the rays see surface. How often each piece of
// surface will be grown is counted on the cameras (SurfaceToGrow). What it cannot know is how much is hidden, and how
// the rest of the scene differs from the tried cameras' part. Bad input: no pair, or a photograph that cannot be used.
absl::StatusOr<TimeEstimate> EstimateTime(const Scene& scene, const ReconstructionOptions& options, int threads);

nlohmann::ordered_json ToJson(const TimeEstimate& estimate);
// "about 3:20 on 2 threads, 6:10 of CPU; from a trial of IMG_1, IMG_7 at a lattice of 7 px".
std::string ToText(const TimeEstimate& estimate);

}  // namespace meshwright
