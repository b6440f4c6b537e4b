// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include <absl/status/status.h>

#include "common/scene/scene.h"

namespace meshwright {

// Gives every view whose photograph has a mask its mask_path. In masks/ in a folder of photographs or beside one that
// is called images/, or in `masks_folder` where that is not empty, a mask is called NAME.EXT.png (COLMAP), STEM.png,
// STEM_mask.* or STEM.mask.png (OpenDroneMap, OpenMVS), in sub-folders as the photographs are; beside its photograph
// all but STEM.png, where no `masks_folder` is told. Warns of masks that belong to no photograph. NotFound: no such
// folder, or none of its files is a mask of a photograph.
absl::Status FindMasks(const std::vector<std::string>& image_folders, const std::string& masks_folder, Scene* scene);

}  // namespace meshwright
