// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <absl/status/status.h>

#include "coordinator/acceptance/acceptance.h"
#include "coordinator/incidence/feasible_pairs.h"
#include "coordinator/incidence/overlap_graph.h"
#include "coordinator/incidence/target_selection.h"
#include "coordinator/schedule/schedule.h"

namespace meshwright {

// What a reconstruction may decide differently on the coordinator's side.
struct ConductorOptions {
  FeasiblePairOptions pairs;
  OverlapOptions overlap;
  TargetSelectionOptions targets;
  int window = ScheduleOptions{}.window;  // W of the order rule, >= 1
  AcceptanceOptions acceptance;           // its k_a is also the K_a of the order rule
  // Filtered surfaces of overlapping cameras that acceptance holds one camera's against, the largest ones, >= 1. In a
  // dense set hundreds of cameras overlap each other and nearly all surface is in a few. V_r has no such limit:
  // accepted surfaces hardly overlap, so that all of them together are no larger than what the camera sees.
  int max_surfaces = 32;
  // What workers deliver is held against it: surfaces have nodes so many pixels apart, or further where a job was made
  // smaller. >= 1.
  int lattice_step = 1;

  absl::Status Validate() const;
};

}  // namespace meshwright
