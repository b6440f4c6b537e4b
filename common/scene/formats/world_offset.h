// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "common/scene/scene.h"

namespace meshwright {

// Chooses scene->offset and moves poses and points by it, where coordinates are so far from zero that floats, which
// surfaces and meshes have, would lose what photographs show: further than ten times the cameras' extent and than 10^4
// times the median distance of a camera to the next one. It is the cameras' centroid rounded to 100 units (to fewer
// where cameras are closer than a unit), so that it can be written in few digits, and 0 along axes that are near.
void MoveNearZero(Scene* scene);

}  // namespace meshwright
