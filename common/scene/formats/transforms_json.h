// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "common/scene/formats/import_options.h"
#include "common/scene/scene.h"

namespace meshwright {

// transforms.json, or transforms_train.json (Blender's sets, with _test and _val) in the folder. Empty: none.
std::string FindTransformsJson(const std::string& folder);

// Reads the cameras of nerfstudio, instant-ngp and of Blender's sets, in the world from before applied_transform and
// applied_scale. The format has points without the photographs that show them: they are left out. Errors: NotFound (a
// picture is missing), InvalidArgument (names file, field, value and what was expected).
absl::StatusOr<Scene> ImportTransformsJson(const std::string& file, const ImportOptions& options);

}  // namespace meshwright
