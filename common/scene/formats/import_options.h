// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <string>

namespace meshwright {

// What a user may say about a scene instead of leaving it to its content.
struct ImportOptions {
  std::optional<std::string> format;  // a name of SceneFormats()
  std::optional<int> model;           // which of several reconstructions in the scene; without it the largest
  std::string images_folder;          // where the photographs are; empty: the places that are usual for the format
  std::optional<std::array<double, 4>> intrinsics;  // fx fy cx cy in px, of all photographs; for formats without
  std::string masks_folder;                         // where masks are; empty: the places that are usual
  std::string region;            // a file, "auto", "none", or empty for region.json in the scene's folder
  bool rescale_cameras = false;  // cameras follow photographs that are larger or smaller by a common factor
};

}  // namespace meshwright
