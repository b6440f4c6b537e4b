// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/surface_mesh.h"

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "common/mesh/ply.h"
#include "common/surface/triangulation.h"

namespace meshwright {

TriangleMesh MeshOfSurface(const SparseSurface& surface) {
  TriangleMesh mesh;
  const std::vector<std::array<int32_t, 3>> triangles = Triangulate(surface);
  constexpr uint32_t kUnused = std::numeric_limits<uint32_t>::max();
  std::vector<uint32_t> vertex_of_patch(surface.patches(), kUnused);
  for (const auto& triangle : triangles) {
    for (const int32_t patch : triangle) vertex_of_patch[static_cast<size_t>(patch)] = 0;
  }
  for (size_t patch = 0; patch < surface.patches(); ++patch) {
    if (vertex_of_patch[patch] == kUnused) continue;
    vertex_of_patch[patch] = static_cast<uint32_t>(mesh.positions.size());
    mesh.positions.emplace_back(surface.Point(patch).cast<float>());
    mesh.normals.push_back(surface.normal_in_world[patch]);
    mesh.colors.push_back(surface.rgb[patch]);
    mesh.quality.push_back(surface.quality[patch]);
  }
  mesh.cameras.assign(mesh.positions.size(), surface.camera_index);
  mesh.faces.reserve(triangles.size());
  for (const auto& [a, b, c] : triangles) {
    mesh.faces.push_back({vertex_of_patch[static_cast<size_t>(a)], vertex_of_patch[static_cast<size_t>(b)],
                          vertex_of_patch[static_cast<size_t>(c)]});
  }
  return mesh;
}

absl::Status WriteSurfacePart(const SparseSurface& surface, const Eigen::Vector3d& offset, const std::string& path) {
  TriangleMesh mesh = MeshOfSurface(surface);
  mesh.offset = offset;
  return WritePly(mesh, path);
}

}  // namespace meshwright
