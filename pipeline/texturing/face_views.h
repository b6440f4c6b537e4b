// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <absl/types/span.h>

#include "pipeline/texturing/depth_raster.h"

#include "common/base/ids.h"
#include "common/base/thread_pool.h"
#include "common/image/color_image.h"
#include "common/image/ignored_pixels.h"
#include "common/mesh/triangle_mesh.h"

namespace meshwright {

// A photograph that can give a face its colours.
struct FaceView {
  CameraIndex camera = 0;
  // Integral over the face's image of the magnitude of the gradient (Waechter et al. 2014, section 4.1), plus a little
  // for each pixel, so that area counts where there is no texture. Grey levels x px.
  float quality = 0;
  uint8_t visible = 0;                       // share of the face that nothing stands before, of 255
  std::array<uint8_t, 3> color = {0, 0, 0};  // mean over the face
};

// For each face the photographs that see it, best first; the best kMost of them are kept.
class FaceViews {
 public:
  static constexpr size_t kMost = 10;

  explicit FaceViews(size_t faces) : counts_(faces, 0), views_(faces * kMost) {}

  size_t faces() const { return counts_.size(); }
  absl::Span<const FaceView> Of(size_t face) const { return {&views_[face * kMost], counts_[face]}; }

  // Adds the photograph of raster.camera() to all faces that it sees: from the front, 2 px from the photograph's
  // border, without ignored pixels, with at least half of it before everything else. Sure of that is one at less than
  // 75 degrees from the normal and clear of silhouettes; others are for faces that no photograph is sure of.
  void AddPhotograph(const TriangleMesh& mesh, const DepthRaster& raster, CameraIndex camera, const ColorImage& image,
                     const IgnoredPixels& ignored, ThreadPool& pool);

  // Leaves out, for each face, photographs that show less of it than the best does, and those whose colour differs from
  // what most others have there (section 4.2: moving things, occluders that were not reconstructed). Until then a face
  // that is half hidden in all photographs has those that show half.
  void RemoveOutliers(ThreadPool& pool);

 private:
  void Add(size_t face, const FaceView& view);

  std::vector<uint8_t> counts_;
  std::vector<FaceView> views_;
};

}  // namespace meshwright
