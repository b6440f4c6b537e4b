// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "worker/agent/agent.h"

namespace meshwright {

// RefineCameras for a worker: photographs come from blobs, options as ParseOptions reads them.
CameraRefiner MakeCameraRefiner();

}  // namespace meshwright
