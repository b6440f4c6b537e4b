// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "common/scene/formats/import_options.h"
#include "common/scene/scene.h"

namespace meshwright {

// *.out in the folder or in bundle/ in it whose first line is "# Bundle file v0.3". Empty: none.
std::string FindBundler(const std::string& folder);

// Reads a Bundler file (Snavely 2006, v0.3) and the list of its photographs: NAME.list.txt, list.txt, or the only *.txt
// beside it whose lines begin with names of pictures. The principal point is the middle of the picture, whose header
// tells its size. Errors: NotFound (list or a picture is missing), InvalidArgument (names file, line, field, value and
// what was expected).
absl::StatusOr<Scene> ImportBundler(const std::string& file, const ImportOptions& options);

}  // namespace meshwright
