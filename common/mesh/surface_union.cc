#include "common/mesh/surface_union.h"

#include <limits>
#include <utility>
#include <vector>

#include "common/base/status_macros.h"
#include "common/mesh/ply.h"
#include "common/surface/triangulation.h"

namespace meshwright {
namespace {

constexpr PlyAttributes kAttributes = {.normals = true, .colors = true, .quality = true, .cameras = true};

}  // namespace

TriangleMesh MeshOfSurface(const PatchLattice& surface) {
  const std::vector<std::array<int32_t, 3>> triangles = TriangulateLattice(surface);
  constexpr uint32_t kUnused = std::numeric_limits<uint32_t>::max();
  std::vector<uint32_t> vertex_of_node(surface.depth.size(), kUnused);
  for (const auto& triangle : triangles) {
    for (const int32_t node : triangle) vertex_of_node[static_cast<size_t>(node)] = 0;
  }
  uint32_t vertices = 0;
  for (uint32_t& vertex : vertex_of_node) {
    if (vertex != kUnused) vertex = vertices++;
  }

  TriangleMesh mesh;
  mesh.positions.reserve(vertices);
  mesh.normals.reserve(vertices);
  mesh.colors.reserve(vertices);
  mesh.quality.reserve(vertices);
  mesh.cameras.assign(vertices, surface.camera_index);
  size_t node = 0;
  for (int row = 0; row < surface.lattice.rows; ++row) {
    for (int column = 0; column < surface.lattice.columns; ++column, ++node) {
      if (vertex_of_node[node] == kUnused) continue;
      mesh.positions.emplace_back(surface.Point(column, row).cast<float>());
      mesh.normals.push_back(surface.normal_in_world[node]);
      mesh.colors.push_back(surface.rgb[node]);
      mesh.quality.push_back(surface.quality[node]);
    }
  }
  mesh.faces.reserve(triangles.size());
  for (const auto& [a, b, c] : triangles) {
    mesh.faces.push_back({vertex_of_node[static_cast<size_t>(a)], vertex_of_node[static_cast<size_t>(b)],
                          vertex_of_node[static_cast<size_t>(c)]});
  }
  return mesh;
}

absl::StatusOr<SurfaceUnionCounts> WriteSurfaceUnion(int64_t count, const LoadSurface& load, const std::string& path) {
  MW_ASSIGN_OR_RETURN(PlyStreamWriter writer, PlyStreamWriter::Create(path, kAttributes));
  for (int64_t index = 0; index < count; ++index) {
    TriangleMesh part;
    {
      MW_ASSIGN_OR_RETURN(const PatchLattice surface, load(index));
      part = MeshOfSurface(surface);
    }
    MW_RETURN_IF_ERROR(writer.Append(part));
  }
  MW_RETURN_IF_ERROR(writer.Commit());
  return SurfaceUnionCounts{writer.vertices(), writer.faces()};
}

absl::Status WriteSurfacePart(const PatchLattice& surface, const std::string& path) {
  return WritePly(MeshOfSurface(surface), path);
}

}  // namespace meshwright
