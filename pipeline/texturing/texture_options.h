// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <absl/status/status.h>

namespace meshwright {

// How a mesh gets a texture atlas. Pixel footprints g = z / f are those of the photographs as they are used.
struct TextureOptions {
  int max_image_size = 0;     // px, longest side of the photographs used; 0: as they are
  double max_error = 1;       // of the simplified mesh, g, 0 .. 100; 0: as it is
  int max_page_size = 4096;   // px, side of a page of the atlas, 256 .. 16384
  double seam_cost = 2;       // of an edge between two photographs, in units of the best photograph's quality, 0 .. 100
  bool png = false;           // pages without loss
  int jpeg_quality = 92;      // 1 .. 100
  bool compressed = false;    // GLB by EXT_meshopt_compression
  bool adjust_colors = true;  // levels seams; without it photographs are cut and pasted as they are

  absl::Status Validate() const;
};

}  // namespace meshwright
