// SPDX-License-Identifier: Apache-2.0
#include "pipeline/texturing/seams.h"

#include <algorithm>
#include <cmath>

#include "pipeline/texturing/label_solver.h"

namespace meshwright {
namespace {

constexpr int kMaxSamples = 512;
constexpr double kSamplesPerPixel = 2;

Eigen::Vector2d Project(const TriangleMesh& mesh, const Camera& camera, uint32_t vertex) {
  return camera.ProjectFromCam(camera.CamFromWorld(mesh.positions[vertex].cast<double>()));
}

}  // namespace

Eigen::Vector3f SampleColor(const ColorImage& image, const Eigen::Vector2d& pixel) {
  const double x = std::clamp(pixel.x() - 0.5, 0.0, image.width - 1.0);
  const double y = std::clamp(pixel.y() - 0.5, 0.0, image.height - 1.0);
  const int x0 = std::min(static_cast<int>(x), image.width - 2);
  const int y0 = std::min(static_cast<int>(y), image.height - 2);
  const auto right = static_cast<float>(x - x0);
  const auto down = static_cast<float>(y - y0);
  const auto at = [&](int dx, int dy) {
    const std::array<uint8_t, 3> rgb = image.At(x0 + dx, y0 + dy);
    return Eigen::Vector3f(rgb[0], rgb[1], rgb[2]);
  };
  return (1 - down) * ((1 - right) * at(0, 0) + right * at(1, 0)) + down * ((1 - right) * at(0, 1) + right * at(1, 1));
}

Seams::Seams(const TriangleMesh& mesh, const std::vector<InnerEdge>& edges, const std::vector<Chart>& charts,
             const std::vector<Camera>& cameras)
    : around_(charts.size()) {
  std::vector<int32_t> chart_of_face(mesh.faces.size());
  for (size_t c = 0; c < charts.size(); ++c) {
    for (const uint32_t f : charts[c].faces) chart_of_face[f] = static_cast<int32_t>(c);
  }
  size_t samples = 0;
  for (const InnerEdge& edge : edges) {
    Seam seam;
    seam.vertices = edge.vertices;
    for (size_t side = 0; side < 2; ++side) {
      seam.charts[side] = chart_of_face[static_cast<size_t>(edge.faces[side])];
      seam.labels[side] = charts[static_cast<size_t>(seam.charts[side])].label;
    }
    if (seam.labels[0] == seam.labels[1] || seam.labels[0] == kNoLabel || seam.labels[1] == kNoLabel) continue;
    double longest = 0;
    for (const int32_t label : seam.labels) {
      const Camera& camera = cameras[static_cast<size_t>(label)];
      longest =
          std::max(longest, (Project(mesh, camera, seam.vertices[0]) - Project(mesh, camera, seam.vertices[1])).norm());
    }
    seam.samples = 2 + static_cast<int>(std::min<double>(kMaxSamples, kSamplesPerPixel * longest));
    seam.first_sample = samples;
    samples += static_cast<size_t>(seam.samples);
    for (const int32_t chart : seam.charts) {
      around_[static_cast<size_t>(chart)].push_back(static_cast<int32_t>(seams_.size()));
    }
    seams_.push_back(seam);
  }
  for (auto& colors : colors_) colors.resize(samples, Eigen::Vector3f::Zero());
}

void Seams::Sample(const TriangleMesh& mesh, int32_t label, const Camera& camera, const ColorImage& image,
                   ThreadPool& pool) {
  pool.ParallelFor(static_cast<int64_t>(seams_.size()), 256, [&](int64_t begin, int64_t end) {
    for (auto s = static_cast<size_t>(begin); s < static_cast<size_t>(end); ++s) {
      const Seam& seam = seams_[s];
      for (size_t side = 0; side < 2; ++side) {
        if (seam.labels[side] != label) continue;
        const Eigen::Vector3d a = mesh.positions[seam.vertices[0]].cast<double>();
        const Eigen::Vector3d b = mesh.positions[seam.vertices[1]].cast<double>();
        for (int i = 0; i < seam.samples; ++i) {
          const Eigen::Vector3d x = a + Place(seam, i) * (b - a);
          colors_[side][seam.first_sample + static_cast<size_t>(i)] =
              SampleColor(image, camera.ProjectFromCam(camera.CamFromWorld(x)));
        }
      }
    }
  });
}

}  // namespace meshwright
