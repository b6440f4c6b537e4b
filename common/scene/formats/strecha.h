// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "common/scene/formats/import_options.h"
#include "common/scene/scene.h"

namespace meshwright {

// The folder of *.camera files: cameras/ or gt_dense_cameras/ (as the sets were published) in `folder`, or `folder`
// itself. Empty when none has any.
std::string FindStrechaCameras(const std::string& folder);

// Reads a set in the form of Strecha et al. (2008): a file X.jpg.camera for each picture X.jpg, which is in images/, in
// `folder` or beside its camera file. A file has K (three rows), a row 0 0 0, the rotation from camera to world (three
// rows), the centre, and the picture's size. Errors: NotFound (a picture is missing), InvalidArgument (names file,
// line, field, value and what was expected).
absl::StatusOr<Scene> ImportStrecha(const std::string& folder, const ImportOptions& options);

}  // namespace meshwright
