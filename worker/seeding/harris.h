// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "common/base/thread_pool.h"
#include "common/image/sampling_image.h"

namespace meshwright {

// A corner of an image, to the pixel. Its centre is (x + 0.5, y + 0.5).
struct Corner {
  int32_t x = 0;       // px
  int32_t y = 0;       // px
  float response = 0;  // det(M) - k tr(M)^2, (grey levels / px)^4

  bool operator==(const Corner&) const = default;
};

// Harris and Stephens 1988, "A combined corner and edge detector".
struct HarrisOptions {
  int cell_size = 32;         // px, >= 4: corners are spread over cells of this size ...
  int corners_per_cell = 5;   // ... the strongest few of each are kept, >= 1
  float k = 0.06F;            // weight of the squared trace, 0..0.25
  float min_response = 1.0F;  // (grey levels / px)^4, > 0; noise of one grey level stays far below
};

// Corners keep this distance to the image's border: half the support of the filter.
constexpr int kHarrisMargin = 4;  // px

// Corners of level 0 but for ignored pixels, by cells row by row, strongest first within a cell. The response is the
// Harris measure of the 3 x 3 Sobel gradients' moments under a 5 x 5 binomial window; corners are its maxima over 3 x 3
// pixels. The image is filtered in strips: memory beside the result is linear in its width, and threads do not change
// the result.
std::vector<Corner> DetectHarrisCorners(const SamplingImage& image, const HarrisOptions& options, ThreadPool& pool);

}  // namespace meshwright
