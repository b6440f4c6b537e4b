// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "common/scene/formats/import_options.h"
#include "common/scene/scene.h"

namespace meshwright {

// Reads a BlocksExchange file (Bentley ContextCapture; Metashape writes it too): the first block's photogroups with a
// perspective camera, photographs with a pose, and tie points. Photographs are sought by the last part of their path in
// the file's folder and in images/ in it. Errors: NotFound (a picture is missing), InvalidArgument (names file, line,
// field, value and what was expected).
absl::StatusOr<Scene> ImportBlocksExchange(const std::string& file, const ImportOptions& options);

}  // namespace meshwright
