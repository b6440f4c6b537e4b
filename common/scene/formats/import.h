// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "common/scene/formats/import_options.h"
#include "common/scene/scene.h"

namespace meshwright {

// Reads the cameras and sparse points of the scene in the folder `path` and checks every picture's header against its
// camera; nothing is decoded. The format is told from what is in the folder, or forced. Where a folder has several, the
// first in the order of SceneFormats() is taken and Scene::warnings name the others, as they do everything else that
// was left out. A few photographs may be missing: their cameras are dropped while at least three and half of them stay.
// Errors are one line that names file, line or field, value and what was expected: NotFound (folder, file or pictures
// are missing), InvalidArgument (anything else that is wrong with the scene).
absl::StatusOr<Scene> ImportScene(const std::string& path, const ImportOptions& options = {});

// Whether the folder `path` has what one of the formats looks for.
bool HoldsScene(const std::string& path);

}  // namespace meshwright
