// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <absl/status/status.h>

#include "common/base/ids.h"
#include "coordinator/incidence/camera_probes.h"

namespace meshwright {

// Which cameras of O_r a camera job compares its reference with. The paper takes all of O_r; a dense set has a hundred
// there, and a job's memory and time must not grow with the set.
struct TargetSelectionOptions {
  int max_targets = 8;             // images in a job beside the reference, >= 1
  double best_min_angle_deg = 10;  // apical angles from here ..., degrees, > 0 (Goesele et al. 2007: 10)
  double best_max_angle_deg = 20;  // ... to here count in full, degrees, >= best_min_angle_deg
  double apart_angle_deg = 8;  // targets closer to each other than this, seen from the surface, repeat; degrees, > 0

  absl::Status Validate() const;
};

// At most max_targets of `neighbours`, best first. Greedy, after Goesele et al. 2007 ("Multi-view stereo for community
// photo collections", section 4) and the score of Yao et al. 2018 (MVSNet): each step takes the camera with the largest
// sum over the probes of r that it sees of (weight of its apical angle) * (scale ratio) * (for each target chosen
// before, weight of the angle between the two). The last factor spreads the targets around r instead of lining them up.
// Ties: lowest index. Neighbours that see no probe come last, in their order. Depends on nothing but its arguments.
std::vector<CameraIndex> ChooseTargets(CameraIndex reference, const std::vector<CameraIndex>& neighbours,
                                       const std::vector<CameraGeometry>& cameras,
                                       const std::vector<CameraProbes>& probes, const TargetSelectionOptions& options);

}  // namespace meshwright
