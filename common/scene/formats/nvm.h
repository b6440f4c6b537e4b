// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "common/scene/formats/import_options.h"
#include "common/scene/scene.h"

namespace meshwright {

// Reads VisualSFM's N-View match file, NVM_V3, of several models in it the one with most photographs or that of
// options.model. The principal point is the middle of the picture, unless the first line fixes it. Its distortion goes
// from distorted to undistorted, x = x_d (1 + d r_d^2), which is the division model to first order: the lens gets the
// radial coefficient that does the same at first order, -d, as COLMAP writes it. Errors: NotFound (a picture is
// missing), InvalidArgument (names file, line, field, value and what was expected).
absl::StatusOr<Scene> ImportNvm(const std::string& file, const ImportOptions& options);

}  // namespace meshwright
