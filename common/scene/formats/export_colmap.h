// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/status.h>

#include "common/scene/scene.h"

namespace meshwright {

// Writes the scene as a COLMAP text model (cameras.txt, images.txt, points3D.txt) into `folder`, which is made when it
// is not there. Pictures are not copied; the scene's offset is added. Views with equal lenses share a camera; where a
// point is seen in an image is computed, not measured. Reading it back gives the same scene, rotations up to rounding;
// a radial lens with two focal lengths comes back under the name of the wider model that has them. InvalidArgument: a
// lens that COLMAP has no model for (skew), a name with a line break or without characters; else the system's reason.
absl::Status ExportColmapText(const Scene& scene, const std::string& folder);

}  // namespace meshwright
