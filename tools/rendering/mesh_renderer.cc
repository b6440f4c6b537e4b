// SPDX-License-Identifier: Apache-2.0
#include "tools/rendering/mesh_renderer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Geometry>

#include "tools/raycast/depth_map.h"

namespace meshwright {
namespace {

Eigen::Vector3f ToFloat(const std::array<uint8_t, 3>& rgb) {
  return {static_cast<float>(rgb[0]), static_cast<float>(rgb[1]), static_cast<float>(rgb[2])};
}

// Well separated hues by the golden ratio, so that neighbours in number differ.
Eigen::Vector3f CameraColor(CameraIndex camera) {
  const float turns = 0.618034F * static_cast<float>(camera % 4096);
  const float hue = 6 * (turns - std::floor(turns));
  const auto channel = [hue](float shift) {
    const float h = std::fmod(hue + shift, 6.0F);
    return 80 + 175 * std::clamp(std::abs(h - 3) - 1, 0.0F, 1.0F);
  };
  return {channel(0), channel(4), channel(2)};
}

Shading Available(const TriangleMesh& mesh, Shading wanted) {
  if (wanted == Shading::kColors && mesh.colors.empty()) return Shading::kNormals;
  if (wanted == Shading::kCameras && mesh.cameras.empty()) return Shading::kNormals;
  return wanted;
}

// Colour of a surface whose unit normal has this cosine to the direction towards the camera.
Eigen::Vector3f Lit(const Eigen::Vector3f& color, double cosine) {
  const auto light = static_cast<float>(0.2 + 0.8 * std::abs(cosine));
  return cosine >= 0 ? Eigen::Vector3f(light * color)
                     : Eigen::Vector3f(light * color.x(), 0.35F * light * color.y(), 0.35F * light * color.z());
}

}  // namespace

MeshRenderer::MeshRenderer(const TriangleMesh& mesh) : mesh_(mesh), caster_(mesh) {}

ColorImage MeshRenderer::Render(const Camera& camera, const RenderOptions& options, ThreadPool& pool) const {
  if (mesh_.faces.empty()) return RenderPoints(camera, options);
  const Shading shading = Available(mesh_, options.shading);
  const Eigen::Vector3d center = camera.center_in_world();
  const Eigen::Matrix3d world_from_cam = camera.cam_from_world.rotation.transpose();
  const auto color_of = [&](const RayHit& hit, const Eigen::Vector3d& direction) -> Eigen::Vector3f {
    if (!hit.ok()) return ToFloat(options.background);
    const std::array<uint32_t, 3>& face = mesh_.faces[static_cast<size_t>(hit.face)];
    const float w = 1 - hit.u - hit.v;
    if (shading == Shading::kColors) {
      return w * ToFloat(mesh_.colors[face[0]]) + hit.u * ToFloat(mesh_.colors[face[1]]) +
             hit.v * ToFloat(mesh_.colors[face[2]]);
    }
    const Eigen::Vector3f base =
        shading == Shading::kCameras ? CameraColor(mesh_.cameras[face[0]]) : Eigen::Vector3f(230, 230, 230);
    return Lit(base, -caster_.FaceNormal(hit.face).dot(direction.normalized()));
  };
  ColorImage image{camera.width, camera.height, {}};
  image.rgb.resize(3 * static_cast<size_t>(camera.width) * static_cast<size_t>(camera.height));
  pool.ParallelFor(camera.height, 4, [&](int64_t begin, int64_t end) {
    auto* out = &image.rgb[3 * static_cast<size_t>(begin) * static_cast<size_t>(camera.width)];
    for (int row = static_cast<int>(begin); row < static_cast<int>(end); ++row) {
      for (int column = 0; column < camera.width; ++column) {
        std::array<Eigen::Vector3d, 4> directions;
        for (size_t i = 0; i < 4; ++i) {
          const double dx = i % 2 == 0 ? 0.25 : 0.75;
          const double dy = i < 2 ? 0.25 : 0.75;
          directions[i] = world_from_cam * camera.RayInCam(column + dx, row + dy);
        }
        const std::array<RayHit, 4> hits = caster_.Cast4(center, directions);
        Eigen::Vector3f sum = Eigen::Vector3f::Zero();
        for (size_t i = 0; i < 4; ++i) sum += color_of(hits[i], directions[i]);
        for (int channel = 0; channel < 3; ++channel) {
          *out++ = static_cast<uint8_t>(std::clamp(0.25F * sum[channel] + 0.5F, 0.0F, 255.0F));
        }
      }
    }
  });
  return image;
}

ColorImage MeshRenderer::RenderPoints(const Camera& camera, const RenderOptions& options) const {
  const Shading shading = Available(mesh_, options.shading);
  const auto pixels = static_cast<size_t>(camera.width) * static_cast<size_t>(camera.height);
  ColorImage image{camera.width, camera.height, {}};
  for (size_t i = 0; i < pixels; ++i) {
    image.rgb.insert(image.rgb.end(), options.background.begin(), options.background.end());
  }
  std::vector<double> nearest(pixels, std::numeric_limits<double>::infinity());
  const Eigen::Vector3d center = camera.center_in_world();
  for (size_t i = 0; i < mesh_.positions.size(); ++i) {
    const Eigen::Vector3d x = mesh_.positions[i].cast<double>();
    const Eigen::Vector3d x_in_cam = camera.CamFromWorld(x);
    if (!(x_in_cam.z() > 0)) continue;
    const Eigen::Vector2d pixel = camera.ProjectFromCam(x_in_cam);
    if (!camera.Contains(pixel)) continue;
    Eigen::Vector3f color(230, 230, 230);
    if (shading == Shading::kColors) color = ToFloat(mesh_.colors[i]);
    if (shading == Shading::kCameras) color = CameraColor(mesh_.cameras[i]);
    if (shading != Shading::kColors && !mesh_.normals.empty()) {
      color = Lit(color, mesh_.normals[i].cast<double>().dot((center - x).normalized()));
    }
    const int column = static_cast<int>(pixel.x());
    const int row = static_cast<int>(pixel.y());
    const int radius = options.point_radius;
    for (int y = std::max(0, row - radius); y <= std::min(camera.height - 1, row + radius); ++y) {
      for (int x_px = std::max(0, column - radius); x_px <= std::min(camera.width - 1, column + radius); ++x_px) {
        const size_t target = static_cast<size_t>(y) * static_cast<size_t>(camera.width) + static_cast<size_t>(x_px);
        if (x_in_cam.z() >= nearest[target]) continue;
        nearest[target] = x_in_cam.z();
        for (size_t channel = 0; channel < 3; ++channel) {
          image.rgb[3 * target + channel] = static_cast<uint8_t>(color[static_cast<Eigen::Index>(channel)]);
        }
      }
    }
  }
  return image;
}

Eigen::Vector3d MeshRenderer::Pivot(const Camera& camera, ThreadPool& pool) const {
  const DepthMap map = RenderDepth(caster_, camera, std::max(1, camera.width / 64), pool);
  std::vector<double> depths;
  for (const float z : map.depth) {
    if (z > 0) depths.push_back(z);
  }
  if (depths.empty()) {
    for (const Eigen::Vector3f& x : mesh_.positions) {
      const double z = camera.CamFromWorld(x.cast<double>()).z();
      if (z > 0) depths.push_back(z);
    }
  }
  double depth = 1;
  if (!depths.empty()) {
    const auto middle = depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2);
    std::nth_element(depths.begin(), middle, depths.end());
    depth = *middle;
  }
  return camera.center_in_world() + depth * camera.viewing_direction_in_world();
}

Camera OrbitCamera(const Camera& camera, const Eigen::Vector3d& pivot, double yaw, double pitch) {
  // Moving the camera right and up is turning the world left and down about the pivot, in the camera's frame.
  const Eigen::Vector3d pivot_in_cam = camera.CamFromWorld(pivot);
  const Eigen::Matrix3d turn =
      (Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitX()) * Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitY()))
          .toRotationMatrix();
  Camera orbited = camera;
  orbited.cam_from_world = Rigid3{turn, pivot_in_cam - turn * pivot_in_cam} * camera.cam_from_world;
  return orbited;
}

}  // namespace meshwright
