// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "tools/raycast/mesh_ray_caster.h"

#include "common/base/thread_pool.h"
#include "common/geometry/camera.h"
#include "common/image/color_image.h"

namespace meshwright {

struct PictureComparison {
  double psnr_db = 0;  // 10 log10(255^2 / mean squared difference of all channels); infinite for equal pictures
  int64_t pixels = 0;  // compared
  double share = 0;    // of the picture
};

// Compares a picture of a surface with the photograph of the same camera where the ray through the pixel's centre meets
// the surface. Both pictures have the camera's size. With `truth`, only where the surface is right, within
// kRightFootprints of it: through a hole something else is seen, whose colours say nothing of how good these are.
constexpr double kRightFootprints = 4;
PictureComparison CompareWhereCovered(const ColorImage& picture, const ColorImage& photograph,
                                      const MeshRayCaster& surface, const Camera& camera, ThreadPool& pool,
                                      const MeshRayCaster* truth = nullptr);

}  // namespace meshwright
