// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "common/scene/formats/import_options.h"
#include "common/scene/scene.h"

namespace meshwright {

// Reads cameras.bin, images.bin and points3D.bin of a COLMAP model in the folder. Errors: NotFound (a file or picture
// is missing), InvalidArgument (names file, record, field, value and what was expected). Counts are believed only as
// far as the file has bytes.
absl::StatusOr<Scene> ImportColmapBinary(const std::string& folder, const ImportOptions& options);

}  // namespace meshwright
