// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "common/scene/formats/import_options.h"
#include "common/scene/scene.h"

namespace meshwright {

// Reads cameras.txt, images.txt and points3D.txt of a COLMAP model in the folder. Errors: NotFound (a file or picture
// is missing), InvalidArgument (names file, line, field, value and what was expected).
absl::StatusOr<Scene> ImportColmapText(const std::string& folder, const ImportOptions& options);

}  // namespace meshwright
