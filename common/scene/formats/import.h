#pragma once

#include <optional>
#include <string>

#include <absl/status/statusor.h>

#include "common/scene/scene.h"

namespace meshwright {

// Reads the cameras and sparse points of the scene in the folder `path` and checks every picture's header against its
// camera; nothing is decoded. The format is told from what is in the folder, or forced: "colmap-text", "colmap-binary",
// "middlebury" or "strecha". Where a COLMAP model is there in both forms, the binary one wins. Errors are one line that
// names file, line or field, value and what was expected: NotFound (folder, file or picture is missing),
// InvalidArgument (anything else that is wrong with the scene).
absl::StatusOr<Scene> ImportScene(const std::string& path, const std::optional<std::string>& format);

}  // namespace meshwright
