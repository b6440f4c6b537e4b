// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "common/scene/formats/import_options.h"
#include "common/scene/scene.h"

namespace meshwright {

// Reads OpenMVS's interface file ("MVSI", versions 0 to 7): platforms, images, vertices with the images that see them.
// Its pixel centres are integers, its points floats. Photographs are sought by their names in the file's folder and in
// images/ in it. Errors: NotFound (a picture is missing), InvalidArgument (names file, record, field, value and what
// was expected). Lengths are believed only as far as the file has bytes.
absl::StatusOr<Scene> ImportOpenMvs(const std::string& file, const ImportOptions& options);

}  // namespace meshwright
