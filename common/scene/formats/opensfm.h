// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "common/scene/formats/import_options.h"
#include "common/scene/scene.h"

namespace meshwright {

// The folder that has reconstruction.json: `folder` or opensfm/ in it (OpenDroneMap). Empty when there is none.
std::string FindOpenSfm(const std::string& folder);

// Reads OpenSfM's reconstruction.json, of several reconstructions the one with most shots or that of options.model, and
// tracks.csv beside it, without which its points are of no use. Photographs are in images/ beside the file, or of a
// folder called opensfm in images/ beside that. Errors: NotFound (a file or picture is missing), InvalidArgument (names
// file, field, value and what was expected).
absl::StatusOr<Scene> ImportOpenSfm(const std::string& folder, const ImportOptions& options);

}  // namespace meshwright
