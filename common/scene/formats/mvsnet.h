// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "common/scene/formats/import_options.h"
#include "common/scene/scene.h"

namespace meshwright {

// The folder whose cams/ (or cams_1/) has *_cam.txt. Empty: none.
std::string FindMvsNet(const std::string& folder);

// Reads a set in the form of MVSNet (Yao et al. 2018): cams/X_cam.txt for images/X.jpg or .png, with the word
// "extrinsic", world to camera in four rows, the word "intrinsic" and K in three. Range and pairs of views are not
// used. Pixel centres are those of COLMAP, where the sets come from. A K that belongs to another size of picture is
// refused, as its principal point shows. Errors: NotFound (a picture is missing), InvalidArgument (names file, line,
// field, value and what was expected).
absl::StatusOr<Scene> ImportMvsNet(const std::string& folder, const ImportOptions& options);

}  // namespace meshwright
