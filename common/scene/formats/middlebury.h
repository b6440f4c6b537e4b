// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "common/scene/formats/import_options.h"
#include "common/scene/scene.h"

namespace meshwright {

// Reads a Middlebury multi-view stereo set (Seitz et al. 2006): the folder's *_par.txt (the count, then for each image
// `name K(9) R(9) t(3)`, P = K [R t]) with the pictures beside it, whose headers tell their size. Errors: NotFound (a
// picture is missing), InvalidArgument (names file, line, field, value and what was expected).
absl::StatusOr<Scene> ImportMiddlebury(const std::string& folder, const ImportOptions& options);

}  // namespace meshwright
