// SPDX-License-Identifier: Apache-2.0
#include "pipeline/texturing/prepared_mesh.h"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <utility>

#include <absl/container/flat_hash_map.h>

#include "common/base/check.h"
#include "common/mesh/mesh_simplification.h"

namespace meshwright {
namespace {

using Face = std::array<uint32_t, 3>;

constexpr size_t kFootprintSamples = 4096;

// Vertices that no face has go.
void Compact(TriangleMesh& mesh) {
  constexpr uint32_t kUnused = std::numeric_limits<uint32_t>::max();
  std::vector<uint32_t> renamed(mesh.positions.size(), kUnused);
  for (const Face& face : mesh.faces) {
    for (const uint32_t v : face) renamed[v] = 0;
  }
  uint32_t next = 0;
  for (size_t v = 0; v < renamed.size(); ++v) {
    if (renamed[v] == kUnused) continue;
    mesh.positions[next] = mesh.positions[v];
    if (!mesh.colors.empty()) mesh.colors[next] = mesh.colors[v];
    renamed[v] = next++;
  }
  mesh.positions.resize(next);
  mesh.positions.shrink_to_fit();
  if (!mesh.colors.empty()) mesh.colors.resize(next);
  for (Face& face : mesh.faces) {
    for (uint32_t& v : face) v = renamed[v];
  }
}

// Middles of edges that are too long, each made once.
class EdgeMiddles {
 public:
  EdgeMiddles(double max_edge, TriangleMesh& mesh) : max_edge_(static_cast<float>(max_edge)), mesh_(mesh) {}

  bool IsLong(uint32_t a, uint32_t b) const { return (mesh_.positions[a] - mesh_.positions[b]).norm() > max_edge_; }

  uint32_t Between(uint32_t a, uint32_t b) {
    const auto [low, high] = std::minmax(a, b);
    const auto [it, is_new] =
        middles_.try_emplace(uint64_t{low} << 32 | high, static_cast<uint32_t>(mesh_.positions.size()));
    if (is_new) {
      mesh_.positions.push_back(0.5F * (mesh_.positions[a] + mesh_.positions[b]));
      if (!mesh_.colors.empty()) {
        std::array<uint8_t, 3> color = {};
        for (size_t k = 0; k < 3; ++k) {
          color[k] = static_cast<uint8_t>((mesh_.colors[a][k] + mesh_.colors[b][k] + 1) / 2);
        }
        mesh_.colors.push_back(color);
      }
    }
    return it->second;
  }

 private:
  const float max_edge_;
  TriangleMesh& mesh_;
  absl::flat_hash_map<uint64_t, uint32_t> middles_;
};

// Two to four triangles in place of one with long edges, by which edges these are; the neighbours across do the same.
void SplitFace(const Face& face, EdgeMiddles& middles, std::vector<Face>& out) {
  std::array<bool, 3> is_long = {};  // edge k: corner k to k + 1
  int count = 0;
  for (size_t k = 0; k < 3; ++k) {
    is_long[k] = middles.IsLong(face[k], face[(k + 1) % 3]);
    count += is_long[k] ? 1 : 0;
  }
  if (count == 0) {
    out.push_back(face);
    return;
  }
  if (count == 3) {
    const uint32_t ab = middles.Between(face[0], face[1]);
    const uint32_t bc = middles.Between(face[1], face[2]);
    const uint32_t ca = middles.Between(face[2], face[0]);
    for (const Face& part : {Face{face[0], ab, ca}, Face{ab, face[1], bc}, Face{ca, bc, face[2]}, Face{ab, bc, ca}}) {
      out.push_back(part);
    }
    return;
  }
  // Turned so that the first edge is long, and the third is not.
  size_t first = 0;
  while (!is_long[first] || is_long[(first + 2) % 3]) ++first;
  const uint32_t a = face[first];
  const uint32_t b = face[(first + 1) % 3];
  const uint32_t c = face[(first + 2) % 3];
  const uint32_t ab = middles.Between(a, b);
  if (count == 1) {
    out.push_back({a, ab, c});
    out.push_back({ab, b, c});
    return;
  }
  const uint32_t bc = middles.Between(b, c);
  out.push_back({ab, b, bc});
  out.push_back({a, ab, bc});
  out.push_back({a, bc, c});
}

void SplitLongEdges(double max_edge, TriangleMesh& mesh) {
  while (true) {
    EdgeMiddles middles(max_edge, mesh);
    std::vector<Face> split;
    split.reserve(mesh.faces.size());
    for (const Face& face : mesh.faces) SplitFace(face, middles, split);
    const bool done = split.size() == mesh.faces.size();
    mesh.faces = std::move(split);
    if (done) return;
  }
}

}  // namespace

double MedianFootprint(const TriangleMesh& mesh, const std::vector<Camera>& cameras) {
  std::vector<double> footprints;
  const size_t step = std::max<size_t>(1, mesh.positions.size() / kFootprintSamples);
  for (size_t v = 0; v < mesh.positions.size(); v += step) {
    double smallest = std::numeric_limits<double>::infinity();
    for (const Camera& camera : cameras) {
      const Eigen::Vector3d x_in_cam = camera.CamFromWorld(mesh.positions[v].cast<double>());
      if (!(x_in_cam.z() > 0) || !camera.Contains(camera.ProjectFromCam(x_in_cam))) continue;
      smallest = std::min(smallest, x_in_cam.z() / camera.focal());
    }
    if (smallest < std::numeric_limits<double>::infinity()) footprints.push_back(smallest);
  }
  if (footprints.empty()) return 0;
  const auto middle = footprints.begin() + static_cast<std::ptrdiff_t>(footprints.size() / 2);
  std::nth_element(footprints.begin(), middle, footprints.end());
  return *middle;
}

TriangleMesh PrepareMesh(TriangleMesh mesh, double max_error, double max_edge) {
  MW_CHECK(max_edge > 0);
  mesh.normals = {};
  mesh.quality = {};
  mesh.cameras = {};
  // Faces without area have no colour, and simplification asks for none that repeat a corner.
  std::erase_if(mesh.faces, [](const Face& f) { return f[0] == f[1] || f[1] == f[2] || f[2] == f[0]; });
  if (max_error > 0 && !mesh.faces.empty()) mesh.faces = SimplifyFaces(mesh.positions, mesh.faces, max_error, {});
  Compact(mesh);
  SplitLongEdges(max_edge, mesh);
  return mesh;
}

}  // namespace meshwright
