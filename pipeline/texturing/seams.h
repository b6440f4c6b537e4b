// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "pipeline/texturing/charts.h"
#include "pipeline/texturing/face_graph.h"

#include "common/base/thread_pool.h"
#include "common/geometry/camera.h"
#include "common/image/color_image.h"
#include "common/mesh/triangle_mesh.h"

namespace meshwright {

// An edge between faces of two photographs, sampled evenly from its first vertex to its second.
struct Seam {
  std::array<uint32_t, 2> vertices;
  std::array<int32_t, 2> charts;
  std::array<int32_t, 2> labels;  // of the charts
  size_t first_sample = 0;
  int samples = 0;  // >= 2, about two a pixel
};

// All seams with the colours that both photographs have along them.
class Seams {
 public:
  Seams(const TriangleMesh& mesh, const std::vector<InnerEdge>& edges, const std::vector<Chart>& charts,
        const std::vector<Camera>& cameras);

  const std::vector<Seam>& all() const { return seams_; }
  // Numbers of the seams around a chart.
  const std::vector<int32_t>& Around(int32_t chart) const { return around_[static_cast<size_t>(chart)]; }

  // Takes the samples of one photograph.
  void Sample(const TriangleMesh& mesh, int32_t label, const Camera& camera, const ColorImage& image, ThreadPool& pool);

  static double Place(const Seam& seam, int sample) { return sample / (seam.samples - 1.0); }  // 0 .. 1
  const Eigen::Vector3f& Color(const Seam& seam, size_t side, int sample) const {
    return colors_[side][seam.first_sample + static_cast<size_t>(sample)];
  }

 private:
  std::vector<Seam> seams_;
  std::vector<std::vector<int32_t>> around_;
  std::array<std::vector<Eigen::Vector3f>, 2> colors_;
};

// Colour at a pixel position, linear between the four pixels around it.
Eigen::Vector3f SampleColor(const ColorImage& image, const Eigen::Vector2d& pixel);

}  // namespace meshwright
