// SPDX-License-Identifier: Apache-2.0
#include "pipeline/texturing/depth_raster.h"

#include <algorithm>
#include <cstdint>

namespace meshwright {
namespace {

constexpr int kBandRows = 32;
constexpr int64_t kVerticesAtOnce = 1 << 14;

// out[i] = max of in[i - reach .. i + reach], for `count` values `stride` apart.
void SpreadLine(const float* in, float* out, int count, size_t stride) {
  for (int i = 0; i < count; ++i) {
    const int begin = std::max(0, i - DepthRaster::kReach);
    const int end = std::min(count - 1, i + DepthRaster::kReach);
    float largest = 0;
    for (int j = begin; j <= end; ++j) largest = std::max(largest, in[static_cast<size_t>(j) * stride]);
    out[static_cast<size_t>(i) * stride] = largest;
  }
}

}  // namespace

DepthRaster::DepthRaster(const TriangleMesh& mesh, const Camera& camera, ThreadPool& pool) : camera_(camera) {
  pixels_.resize(mesh.positions.size());
  depths_.resize(mesh.positions.size());
  pool.ParallelFor(static_cast<int64_t>(mesh.positions.size()), kVerticesAtOnce, [&](int64_t begin, int64_t end) {
    for (auto v = static_cast<size_t>(begin); v < static_cast<size_t>(end); ++v) {
      const Eigen::Vector3d x_in_cam = camera.CamFromWorld(mesh.positions[v].cast<double>());
      depths_[v] = x_in_cam.z();
      pixels_[v] = x_in_cam.z() > 0 ? camera.ProjectFromCam(x_in_cam) : Eigen::Vector2d::Zero();
    }
  });
  nearest_.assign(static_cast<size_t>(camera.width) * static_cast<size_t>(camera.height), 0.0F);
  Draw(mesh, pool);
  Spread(pool);
}

void DepthRaster::Draw(const TriangleMesh& mesh, ThreadPool& pool) {
  const int bands = (camera_.height + kBandRows - 1) / kBandRows;
  // Faces by the bands that they touch, so that each band draws its own alone.
  std::vector<std::vector<uint32_t>> faces_of_band(static_cast<size_t>(bands));
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    const std::array<uint32_t, 3>& face = mesh.faces[f];
    if (!IsInFront(face)) continue;
    const auto [low, high] = std::minmax({pixels_[face[0]].y(), pixels_[face[1]].y(), pixels_[face[2]].y()});
    if (!(high >= 0 && low < camera_.height)) continue;
    const int first = static_cast<int>(std::max(0.0, low)) / kBandRows;
    const int last = static_cast<int>(std::min<double>(camera_.height - 1, high)) / kBandRows;
    for (int band = first; band <= last; ++band) {
      faces_of_band[static_cast<size_t>(band)].push_back(static_cast<uint32_t>(f));
    }
  }
  pool.ParallelFor(bands, 1, [&](int64_t begin, int64_t end) {
    for (int64_t band = begin; band < end; ++band) {
      const int first_row = static_cast<int>(band) * kBandRows;
      const PixelBox box = {0, first_row, camera_.width, std::min(camera_.height, first_row + kBandRows)};
      for (const uint32_t f : faces_of_band[static_cast<size_t>(band)]) {
        const std::array<uint32_t, 3>& face = mesh.faces[f];
        Triangle(face).ForEachPixel(box, [&](int x, int y, const Eigen::Vector3d& weights) {
          float& nearest = nearest_[Index(x, y)];
          nearest = std::max(nearest, static_cast<float>(InverseDepth(face, weights)));
        });
      }
    }
  });
}

void DepthRaster::Spread(ThreadPool& pool) {
  const auto width = static_cast<size_t>(camera_.width);
  std::vector<float> spread(nearest_.size());
  around_.resize(nearest_.size());
  pool.ParallelFor(camera_.height, kBandRows, [&](int64_t begin, int64_t end) {
    for (auto y = static_cast<size_t>(begin); y < static_cast<size_t>(end); ++y) {
      SpreadLine(&nearest_[y * width], &spread[y * width], camera_.width, 1);
    }
  });
  pool.ParallelFor(camera_.width, kBandRows, [&](int64_t begin, int64_t end) {
    for (auto x = static_cast<size_t>(begin); x < static_cast<size_t>(end); ++x) {
      SpreadLine(&spread[x], &around_[x], camera_.height, width);
    }
  });
}

}  // namespace meshwright
