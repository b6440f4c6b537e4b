// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "common/scene/formats/import_options.h"
#include "common/scene/scene.h"

namespace meshwright {

// Reads OpenMVG's sfm_data.json with its poses (views, intrinsics, extrinsics, structure). Photographs are sought in
// the file's folder and in images/ in it. Errors: NotFound (a picture is missing), InvalidArgument (names file, field,
// value and what was expected).
absl::StatusOr<Scene> ImportOpenMvg(const std::string& file, const ImportOptions& options);

}  // namespace meshwright
