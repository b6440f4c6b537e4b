// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/finished_part.h"

#include <algorithm>
#include <array>
#include <cstddef>

#include <Eigen/Geometry>

#include "common/geometry/level_of_detail.h"
#include "common/mesh/mesh_simplification.h"
#include "common/mesh/part_mesh.h"

namespace meshwright {
namespace {

using Face = std::array<uint32_t, 3>;

// Faces of the components that stay.
std::vector<Face> LargeComponents(const PartMesh& mesh, const uint8_t* small) {
  std::vector<Face> faces;
  for (const auto& face : mesh.faces) {
    if (small[mesh.component_of_vertex[static_cast<size_t>(face[0])]] != 0) continue;
    Face& corners = faces.emplace_back();
    std::ranges::transform(face, corners.begin(), [](int32_t v) { return static_cast<uint32_t>(v); });
  }
  return faces;
}

// Scene units; g of the evaluation: what a pixel covers on a surface that faces the camera.
double MedianFootprint(const SparseSurface& surface, const PartMesh& mesh) {
  std::vector<float> depths;
  for (const int32_t patch : mesh.patch_of_vertex) depths.push_back(surface.depth[static_cast<size_t>(patch)]);
  if (depths.empty()) return 0;
  const auto median = depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2);
  std::ranges::nth_element(depths, median);
  return LevelOfDetail(surface.camera, *median, 1);
}

std::vector<Face> Simplify(const SparseSurface& surface, const PartMesh& mesh, const std::vector<Face>& faces,
                           double footprints, const std::vector<std::pair<uint32_t, uint32_t>>& other_edges) {
  std::vector<Eigen::Vector3f> positions;
  positions.reserve(mesh.patch_of_vertex.size());
  for (const int32_t patch : mesh.patch_of_vertex) {
    positions.emplace_back(surface.Point(static_cast<size_t>(patch)).cast<float>());
  }
  return SimplifyFaces(positions, faces, footprints * MedianFootprint(surface, mesh), other_edges);
}

}  // namespace

double TriangleArea(const Eigen::Vector3f& a, const Eigen::Vector3f& b, const Eigen::Vector3f& c) {
  const Eigen::Vector3d origin = a.cast<double>();
  return 0.5 * (b.cast<double>() - origin).cross(c.cast<double>() - origin).norm();
}

FinishedPart FinishPart(const SparseSurface& surface, absl::Span<const uint8_t> trimmed, const PartJoins& joins,
                        int blend_steps, double simplify_footprints) {
  const PartMesh part_mesh = BuildPartMesh(surface, std::vector<uint8_t>(trimmed.begin(), trimmed.end()));
  std::vector<std::array<uint8_t, 3>> colors = surface.rgb;
  BlendSeams(joins.offsets, blend_steps, surface, colors);
  FinishedPart finished;
  TriangleMesh& mesh = finished.mesh;
  mesh.faces = LargeComponents(part_mesh, joins.small);
  if (simplify_footprints > 0) {
    const size_t before = mesh.faces.size();
    mesh.faces = Simplify(surface, part_mesh, mesh.faces, simplify_footprints, joins.edges);
    finished.faces_simplified = static_cast<int64_t>(before - mesh.faces.size());
  }

  finished.index.assign(part_mesh.patch_of_vertex.size(), -1);
  for (const Face& face : mesh.faces) {
    for (const uint32_t v : face) finished.index[v] = 0;
  }
  for (size_t v = 0; v < finished.index.size(); ++v) {
    if (finished.index[v] < 0) continue;
    finished.index[v] = static_cast<int32_t>(mesh.positions.size());
    const auto patch = static_cast<size_t>(part_mesh.patch_of_vertex[v]);
    mesh.positions.emplace_back(surface.Point(patch).cast<float>());
    mesh.normals.push_back(surface.normal_in_world[patch]);
    mesh.colors.push_back(colors[patch]);
    mesh.quality.push_back(surface.quality[patch]);
  }
  mesh.cameras.assign(mesh.positions.size(), surface.camera_index);
  for (Face& face : mesh.faces) {
    for (uint32_t& v : face) v = static_cast<uint32_t>(finished.index[v]);
    finished.area += TriangleArea(mesh.positions[face[0]], mesh.positions[face[1]], mesh.positions[face[2]]);
  }
  return finished;
}

}  // namespace meshwright
