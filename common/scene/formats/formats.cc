#include "common/scene/formats/formats.h"

#include "common/scene/formats/assemble.h"
#include "common/scene/formats/colmap_binary.h"
#include "common/scene/formats/colmap_model.h"
#include "common/scene/formats/colmap_text.h"
#include "common/scene/formats/middlebury.h"
#include "common/scene/formats/strecha.h"

namespace meshwright {

const std::vector<SceneFormat>& SceneFormats() {
  static const std::vector<SceneFormat> formats = {
      {"colmap-binary", ColmapModelFiles("bin"), [](const std::string& path) { return FindColmapModels(path, "bin"); },
       ImportColmapBinary},
      {"colmap-text", ColmapModelFiles("txt"), [](const std::string& path) { return FindColmapModels(path, "txt"); },
       ImportColmapText},
      {"middlebury", "*_par.txt",
       [](const std::string& path) { return FilesEndingIn(path, "_par.txt").empty() ? std::string() : path; },
       ImportMiddlebury},
      {"strecha", "*.camera here, in cameras/ or in gt_dense_cameras/",
       [](const std::string& path) { return FindStrechaCameras(path).empty() ? std::string() : path; }, ImportStrecha},
  };
  return formats;
}

}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
