// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "pipeline/cameras/photograph_folder.h"

namespace meshwright {

// Photographs that one camera with one zoom took: they share focal length and distortion, which makes both far better
// known than photograph by photograph.
struct CameraGroup {
  ImageSize size;                   // px
  double focal_px = 0;              // to begin with
  bool focal_from_exif = false;     // else a guess, 1.2 times the longer side
  bool wide_model = false;          // OPENCV with four coefficients, else SIMPLE_RADIAL with one
  std::vector<size_t> photographs;  // indices, ascending
};

// By folder, make, model, lens, focal length and size, in the order of their first photographs. Few photographs do not
// determine four coefficients of distortion: groups below five get the model with one.
std::vector<CameraGroup> GroupByCamera(const std::vector<Photograph>& photographs);

}  // namespace meshwright
