// SPDX-License-Identifier: Apache-2.0
#include "pipeline/report/mesh_pictures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "pipeline/texturing/triangle_raster.h"

namespace meshwright {
namespace {

constexpr int kMostCells = 64;  // along the longer side

size_t PixelIndex(const Camera& camera, int column, int row) {
  return static_cast<size_t>(row) * static_cast<size_t>(camera.width) + static_cast<size_t>(column);
}

}  // namespace

ColorImage DrawMesh(const MeshRows& mesh, const Camera& camera, uint8_t background) {
  ColorImage image = {.width = camera.width, .height = camera.height};
  const size_t pixels = static_cast<size_t>(camera.width) * static_cast<size_t>(camera.height);
  image.rgb.assign(3 * pixels, background);
  std::vector<float> nearest(pixels, 0);  // 1 / z
  const PixelBox all = {.x1 = camera.width, .y1 = camera.height};
  for (size_t face = 0; face < mesh.faces(); ++face) {
    std::array<Eigen::Vector2d, 3> pixel;
    Eigen::Vector3d inverse_depth;
    std::array<Eigen::Vector3d, 3> color;
    bool is_in_front = true;
    const std::array<uint32_t, 3> corners = mesh.Face(face);
    for (size_t k = 0; k < 3; ++k) {
      const Eigen::Vector3d x_in_cam = camera.CamFromWorld(mesh.Position(corners[k]).cast<double>());
      is_in_front = is_in_front && x_in_cam.z() > 0;
      if (!is_in_front) break;
      pixel[k] = camera.ProjectFromCam(x_in_cam);
      inverse_depth[static_cast<int>(k)] = 1 / x_in_cam.z();
      const std::array<uint8_t, 3> rgb = mesh.Color(corners[k]);
      color[k] = Eigen::Vector3d(rgb[0], rgb[1], rgb[2]);
    }
    if (!is_in_front) continue;
    ImageTriangle(pixel[0], pixel[1], pixel[2]).ForEachPixel(all, [&](int column, int row, const Eigen::Vector3d& w) {
      const size_t at = PixelIndex(camera, column, row);
      const auto depth = static_cast<float>(w.dot(inverse_depth));
      if (depth <= nearest[at]) return;
      nearest[at] = depth;
      const Eigen::Vector3d rgb = w[0] * color[0] + w[1] * color[1] + w[2] * color[2];
      for (size_t k = 0; k < 3; ++k) image.rgb[3 * at + k] = static_cast<uint8_t>(rgb[static_cast<int>(k)] + 0.5);
    });
  }
  return image;
}

MeshSample SampleMesh(const MeshRows& mesh, size_t most) {
  MeshSample sample;
  if (!mesh.has_normals()) return sample;
  const size_t stride = std::max<size_t>(1, (mesh.vertices() + most - 1) / std::max<size_t>(most, 1));
  for (size_t v = 0; v < mesh.vertices(); v += stride) {
    sample.positions.push_back(mesh.Position(v));
    sample.normals.push_back(mesh.Normal(v));
  }
  return sample;
}

double SeenCells::share() const {
  if (seen.empty()) return 0;
  return static_cast<double>(std::ranges::count(seen, true)) / static_cast<double>(seen.size());
}

SeenCells FindSeenCells(const MeshSample& sample, const Camera& camera) {
  std::vector<Eigen::Vector2d> pixels;
  const Eigen::Vector3d center = camera.center_in_world();
  for (size_t i = 0; i < sample.positions.size(); ++i) {
    const Eigen::Vector3d x = sample.positions[i].cast<double>();
    if (!(sample.normals[i].cast<double>().dot(center - x) > 0)) continue;
    const Eigen::Vector3d x_in_cam = camera.CamFromWorld(x);
    if (!(x_in_cam.z() > 0)) continue;
    const Eigen::Vector2d pixel = camera.ProjectFromCam(x_in_cam);
    if (camera.Contains(pixel)) pixels.push_back(pixel);
  }
  // Some four points a cell where the mesh fills the image: hardly a cell of seen surface is without one.
  const int longer = std::max(camera.width, camera.height);
  const double cells = std::max(1.0, static_cast<double>(pixels.size()) / 4);
  const int along = std::clamp(
      static_cast<int>(std::sqrt(cells * longer / std::max(1, std::min(camera.width, camera.height)))), 4, kMostCells);
  SeenCells grid;
  grid.columns = std::max(1, along * camera.width / longer);
  grid.rows = std::max(1, along * camera.height / longer);
  grid.seen.assign(static_cast<size_t>(grid.columns) * static_cast<size_t>(grid.rows), false);
  for (const Eigen::Vector2d& pixel : pixels) {
    const int column = std::min(grid.columns - 1, static_cast<int>(pixel.x() * grid.columns / camera.width));
    const int row = std::min(grid.rows - 1, static_cast<int>(pixel.y() * grid.rows / camera.height));
    grid.seen[static_cast<size_t>(row) * static_cast<size_t>(grid.columns) + static_cast<size_t>(column)] = true;
  }
  return grid;
}

void FadeUnseen(const SeenCells& cells, ColorImage& photograph) {
  const GreyImage grey = ToGrey(photograph);
  for (int row = 0; row < photograph.height; ++row) {
    const int cell_row = row * cells.rows / photograph.height;
    for (int column = 0; column < photograph.width; ++column) {
      const int cell_column = column * cells.columns / photograph.width;
      const size_t cell =
          static_cast<size_t>(cell_row) * static_cast<size_t>(cells.columns) + static_cast<size_t>(cell_column);
      if (cells.seen[cell]) continue;
      // Grey and paler: told from grey surface.
      const auto faded = static_cast<uint8_t>((grey.At(column, row) + 3 * 200) / 4);
      const size_t at =
          3 * (static_cast<size_t>(row) * static_cast<size_t>(photograph.width) + static_cast<size_t>(column));
      std::fill_n(photograph.rgb.begin() + static_cast<std::ptrdiff_t>(at), 3, faded);
    }
  }
}

}  // namespace meshwright
