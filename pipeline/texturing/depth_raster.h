// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Core>

#include "pipeline/texturing/triangle_raster.h"

#include "common/base/thread_pool.h"
#include "common/geometry/camera.h"
#include "common/mesh/triangle_mesh.h"

namespace meshwright {

// A mesh as one camera images it: where its vertices are, and how far the nearest surface is behind each pixel. Drawn
// in software; memory follows the vertices and the pixels of one image.
class DepthRaster {
 public:
  // `mesh` outlives the raster. The result does not depend on the threads.
  DepthRaster(const TriangleMesh& mesh, const Camera& camera, ThreadPool& pool);

  const Camera& camera() const { return camera_; }
  // Pixel of a vertex; only if its depth is positive.
  const Eigen::Vector2d& Pixel(uint32_t vertex) const { return pixels_[vertex]; }
  double Depth(uint32_t vertex) const { return depths_[vertex]; }
  bool IsInFront(const std::array<uint32_t, 3>& face) const {
    return depths_[face[0]] > 0 && depths_[face[1]] > 0 && depths_[face[2]] > 0;
  }
  ImageTriangle Triangle(const std::array<uint32_t, 3>& face) const {
    return {pixels_[face[0]], pixels_[face[1]], pixels_[face[2]]};
  }
  // 1 / z at barycentric coordinates in the image.
  double InverseDepth(const std::array<uint32_t, 3>& face, const Eigen::Vector3d& weights) const {
    return weights.x() / depths_[face[0]] + weights.y() / depths_[face[1]] + weights.z() / depths_[face[2]];
  }

  // The largest 1 / z of any surface behind the pixel's centre, 0 where there is none.
  float NearestInverseDepth(int column, int row) const { return nearest_[Index(column, row)]; }
  // The same of all pixels within kReach of this one: silhouettes of what stands before something are where surfaces
  // are least exact.
  static constexpr int kReach = 2;
  float NearestAround(int column, int row) const { return around_[Index(column, row)]; }

 private:
  size_t Index(int column, int row) const {
    return static_cast<size_t>(row) * static_cast<size_t>(camera_.width) + static_cast<size_t>(column);
  }
  void Draw(const TriangleMesh& mesh, ThreadPool& pool);
  void Spread(ThreadPool& pool);

  const Camera camera_;
  std::vector<Eigen::Vector2d> pixels_;
  std::vector<double> depths_;
  std::vector<float> nearest_;
  std::vector<float> around_;
};

}  // namespace meshwright
