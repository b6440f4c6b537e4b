// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "common/scene/formats/import_options.h"
#include "common/scene/scene.h"

namespace meshwright {

// One way in which scenes are written down.
struct SceneFormat {
  const char* name;       // of --format
  std::string looks_for;  // in a folder, for errors and help
  // What `import` takes, a folder or file in or at `path`; empty when `path` has no such scene.
  std::string (*find)(const std::string& path);
  absl::StatusOr<Scene> (*import)(const std::string& found, const ImportOptions& options);
};

// Every format that is known, in the order in which they are preferred where a folder has several.
const std::vector<SceneFormat>& SceneFormats();

}  // namespace meshwright
