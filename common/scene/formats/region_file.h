// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "common/scene/scene.h"

namespace meshwright {

// Reads a box in the world's coordinates: {"center": [3], "axes": [[3], [3], [3]], "size": [3]}, sizes being full
// lengths along axes, which are rows and need not be there; or [xmin, ymin, zmin, xmax, ymax, zmax]. InvalidArgument
// names file, field, value and what was expected.
absl::StatusOr<OrientedBox> ReadRegion(const std::string& file);

// The box along the axes that has the sparse points from the 1st to the 99th percentile of each coordinate, grown by a
// tenth, local. FailedPrecondition: fewer than 20 points.
absl::StatusOr<OrientedBox> RegionOfPoints(const Scene& scene);

// Sets the scene's region: `region` is a file, "auto" for RegionOfPoints, "none", or "" for region.json in `folder`
// where there is one.
absl::Status SetRegion(const std::string& region, const std::string& folder, Scene* scene);

}  // namespace meshwright
