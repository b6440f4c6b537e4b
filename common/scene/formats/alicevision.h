// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "common/scene/formats/import_options.h"
#include "common/scene/scene.h"

namespace meshwright {

// Reads AliceVision's (Meshroom's) SfMData as JSON, a *.sfm file: views, intrinsics of any version since 1.0, poses and
// structure. Photographs are sought by the last part of their path in the file's folder and in images/ in it. Errors:
// NotFound (a picture is missing), InvalidArgument (names file, field, value and what was expected).
absl::StatusOr<Scene> ImportAliceVision(const std::string& file, const ImportOptions& options);

}  // namespace meshwright
