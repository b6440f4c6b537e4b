// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace meshwright {

// Samples are handled in groups of this many; the sum within a lane and across lanes has one fixed order, and no fused
// multiply-add is used, so that every instruction set gives the same floats.
constexpr int kNccGroup = 8;

// A window of the reference against its image through a homography. Sample k lies at (dx[k], dy[k]) from the window's
// centre and maps to the target at (c + col0 dx + col1 dy) divided by its third coordinate, in coordinates where the
// centre of the top-left pixel is (0, 0). The caller has made sure that every sample lies in
// [0, width - 1) x [0, height - 1), in front of the target.
struct NccInput {
  int count = 0;                   // samples, a multiple of kNccGroup; padding has weight 0
  const float* dx = nullptr;       // px
  const float* dy = nullptr;       // px
  const float* weights = nullptr;  // sum to 1
  const float* values = nullptr;   // weight * (reference - mean) / standard deviation
  float c[3] = {};
  float col0[3] = {};
  float col1[3] = {};
  const uint32_t* quads = nullptr;  // SamplingImage layout
  int stride = 0;                   // entries per row
};

// Normalised cross-correlation in [-1, 1] (up to rounding); 0 when the target has no texture there.
float Ncc(const NccInput& input);

}  // namespace meshwright
