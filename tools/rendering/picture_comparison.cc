// SPDX-License-Identifier: Apache-2.0
#include "tools/rendering/picture_comparison.h"

#include <cmath>
#include <vector>

namespace meshwright {
namespace {

bool IsRight(double distance, const RayHit& truth, const Camera& camera) {
  return truth.ok() && std::abs(distance - truth.distance) <= kRightFootprints * truth.distance / camera.focal();
}

}  // namespace

PictureComparison CompareWhereCovered(const ColorImage& picture, const ColorImage& photograph,
                                      const MeshRayCaster& surface, const Camera& camera, ThreadPool& pool,
                                      const MeshRayCaster* truth) {
  const auto height = static_cast<size_t>(camera.height);
  const auto width = static_cast<size_t>(camera.width);
  const Eigen::Vector3d center = camera.center_in_world();
  const Eigen::Matrix3d world_from_cam = camera.cam_from_world.rotation.transpose();
  std::vector<int64_t> pixels(height, 0);
  std::vector<double> squares(height, 0);
  pool.ParallelFor(camera.height, 4, [&](int64_t begin, int64_t end) {
    for (auto row = static_cast<size_t>(begin); row < static_cast<size_t>(end); ++row) {
      for (size_t column = 0; column < width; ++column) {
        const Eigen::Vector3d direction =
            world_from_cam * camera.RayInCam(static_cast<double>(column) + 0.5, static_cast<double>(row) + 0.5);
        const RayHit hit = surface.Cast(center, direction);
        if (!hit.ok()) continue;
        if (truth != nullptr && !IsRight(hit.distance, truth->Cast(center, direction), camera)) continue;
        ++pixels[row];
        for (size_t k = 3 * (row * width + column); k < 3 * (row * width + column) + 3; ++k) {
          const double difference = static_cast<double>(picture.rgb[k]) - photograph.rgb[k];
          squares[row] += difference * difference;
        }
      }
    }
  });
  PictureComparison comparison;
  double sum = 0;
  for (size_t row = 0; row < height; ++row) {
    comparison.pixels += pixels[row];
    sum += squares[row];
  }
  comparison.psnr_db = 10 * std::log10(255.0 * 255.0 * 3 * static_cast<double>(comparison.pixels) / sum);
  comparison.share = static_cast<double>(comparison.pixels) / static_cast<double>(width * height);
  return comparison;
}

}  // namespace meshwright
