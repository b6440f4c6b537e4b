// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "common/scene/formats/import_options.h"
#include "common/scene/scene.h"

namespace meshwright {

// Reads the cameras that Agisoft Metashape exports as XML (document/chunk), of several chunks or components the one
// with most aligned cameras, in the chunk's own coordinates. It has no sparse points. Photographs are sought by their
// labels in the file's folder and in images/ in it. Errors: NotFound (a picture is missing), InvalidArgument (names
// file, line, field, value and what was expected).
absl::StatusOr<Scene> ImportMetashape(const std::string& file, const ImportOptions& options);

}  // namespace meshwright
