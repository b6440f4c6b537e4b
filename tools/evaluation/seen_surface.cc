// SPDX-License-Identifier: Apache-2.0
#include "tools/evaluation/seen_surface.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Geometry>

#include "tools/raycast/depth_map.h"

namespace meshwright {
namespace {

SeenSurface SeeMesh(const MeshRayCaster& caster, const Camera& camera, int stride, ThreadPool& pool) {
  DepthMap map = RenderDepth(caster, camera, stride, pool);
  SeenSurface seen;
  seen.lattice = map.lattice;
  seen.depth.assign(map.depth.begin(), map.depth.end());
  seen.face = std::move(map.face);
  seen.x_in_world.resize(seen.depth.size());
  for (int row = 0; row < seen.lattice.rows; ++row) {
    for (int column = 0; column < seen.lattice.columns; ++column) {
      const auto node = static_cast<size_t>(seen.lattice.Index(column, row));
      const Eigen::Vector2d pixel = seen.lattice.Pixel(column, row);
      seen.x_in_world[node] = camera.BackProject(pixel.x(), pixel.y(), seen.depth[node]);
    }
  }
  return seen;
}

SeenSurface SeeCloud(const std::vector<Eigen::Vector3f>& points, const Camera& camera, int stride) {
  SeenSurface seen;
  seen.lattice = Lattice::For(camera, stride);
  seen.depth.assign(static_cast<size_t>(seen.lattice.nodes()), 0.0);
  seen.x_in_world.resize(seen.depth.size());
  for (const Eigen::Vector3f& point : points) {
    const Eigen::Vector3d x = point.cast<double>();
    const Eigen::Vector3d x_in_cam = camera.CamFromWorld(x);
    if (!(x_in_cam.z() > 0)) continue;
    const Eigen::Vector2d pixel = camera.ProjectFromCam(x_in_cam);
    if (!camera.Contains(pixel)) continue;
    const int column = static_cast<int>(pixel.x()) - stride / 2;
    const int row = static_cast<int>(pixel.y()) - stride / 2;
    if (column < 0 || row < 0 || column % stride != 0 || row % stride != 0) continue;
    if (!seen.lattice.Contains(column / stride, row / stride)) continue;
    const auto node = static_cast<size_t>(seen.lattice.Index(column / stride, row / stride));
    if (seen.depth[node] > 0 && seen.depth[node] <= x_in_cam.z()) continue;
    seen.depth[node] = x_in_cam.z();
    seen.x_in_world[node] = x;
  }
  return seen;
}

}  // namespace

SeenSurface SeeSurface(const TriangleMesh& mesh, const MeshRayCaster& caster, const Camera& camera, int stride,
                       ThreadPool& pool) {
  return mesh.faces.empty() ? SeeCloud(mesh.positions, camera, stride) : SeeMesh(caster, camera, stride, pool);
}

bool IsSeenByEnough(const MeshRayCaster& caster, absl::Span<const Camera> cameras, const Eigen::Vector3d& x,
                    const Eigen::Vector3d& normal, int min_views, double tolerance) {
  int views = 0;
  for (size_t i = 0; i < cameras.size() && views < min_views; ++i) {
    if (views + static_cast<int>(cameras.size() - i) < min_views) return false;
    const Camera& camera = cameras[i];
    const Eigen::Vector3d x_in_cam = camera.CamFromWorld(x);
    if (x_in_cam.z() <= 0 || !camera.Contains(camera.ProjectFromCam(x_in_cam))) continue;
    const Eigen::Vector3d center = camera.center_in_world();
    if (normal.dot(center - x) <= 0) continue;
    // In lengths of the ray, a pixel footprint is 1 / focal.
    if (!caster.IsBlocked(center, x - center, 0, 1 - tolerance / camera.focal())) ++views;
  }
  return views >= min_views;
}

std::vector<SurfaceSample> SampleSurface(const TriangleMesh& mesh, int count) {
  const auto corner = [&mesh](size_t face, size_t i) -> Eigen::Vector3d {
    return mesh.positions[mesh.faces[face][i]].cast<double>();
  };
  std::vector<double> area_up_to(mesh.faces.size());
  double area = 0;
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    area += 0.5 * (corner(f, 1) - corner(f, 0)).cross(corner(f, 2) - corner(f, 0)).norm();
    area_up_to[f] = area;
  }
  std::vector<SurfaceSample> samples;
  if (!(area > 0) || !std::isfinite(area)) return samples;
  samples.reserve(static_cast<size_t>(count));
  for (int i = 0; i < count; ++i) {
    const auto it = std::upper_bound(area_up_to.begin(), area_up_to.end(), (i + 0.5) / count * area);
    const auto face = std::min(static_cast<size_t>(it - area_up_to.begin()), mesh.faces.size() - 1);
    // Within the triangle: the R2 sequence (multiples of powers of the plastic number), spread evenly over the square
    // and folded.
    double u = (i + 0.5) * 0.7548776662466927;
    double v = (i + 0.5) * 0.5698402909980532;
    u -= std::floor(u);
    v -= std::floor(v);
    if (u + v > 1) {
      u = 1 - u;
      v = 1 - v;
    }
    samples.push_back(
        {(1 - u - v) * corner(face, 0) + u * corner(face, 1) + v * corner(face, 2), static_cast<int32_t>(face)});
  }
  return samples;
}

}  // namespace meshwright
