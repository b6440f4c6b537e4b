// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "worker/agent/camera_estimation.h"

namespace meshwright {

// Estimates cameras by COLMAP; without a version when there is none that can be run, and why is in `*why_not`.
CameraEstimator MakeColmapEstimator(std::string* why_not);

}  // namespace meshwright
