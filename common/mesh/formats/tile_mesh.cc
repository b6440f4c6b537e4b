// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/formats/tile_mesh.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <absl/container/flat_hash_map.h>

namespace meshwright {
namespace {

using Face = std::array<uint32_t, 3>;
using Cell = std::array<int64_t, 3>;

// Appends a vertex of `from`.
uint32_t CopyVertex(const TileMesh& from, size_t v, TileMesh& to) {
  to.positions.push_back(from.positions[v]);
  if (!from.colors.empty()) to.colors.push_back(from.colors[v]);
  to.vertices.push_back(from.vertices[v]);
  to.common_depth.push_back(from.common_depth[v]);
  return static_cast<uint32_t>(to.positions.size() - 1);
}

TileMesh Join(const std::vector<TileMesh>& children) {
  TileMesh joined;
  absl::flat_hash_map<uint32_t, uint32_t> places;  // of the mesh's vertices
  std::vector<uint32_t> place_of_child;
  for (const TileMesh& child : children) {
    place_of_child.clear();
    for (size_t v = 0; v < child.positions.size(); ++v) {
      const uint32_t vertex = child.vertices[v];
      const auto next = static_cast<uint32_t>(joined.positions.size());
      const uint32_t place = vertex == TileMesh::kNoVertex ? next : places.try_emplace(vertex, next).first->second;
      if (place == next) CopyVertex(child, v, joined);
      place_of_child.push_back(place);
    }
    for (const Face& face : child.faces) {
      joined.faces.push_back({place_of_child[face[0]], place_of_child[face[1]], place_of_child[face[2]]});
    }
    joined.box.extend(child.box);
    joined.error = std::max(joined.error, child.error);
  }
  return joined;
}

// Which vertices become one: for each the number of its cluster, in order of the clusters' first vertices.
struct Clusters {
  std::vector<uint32_t> of_vertex;
  size_t count = 0;
};

Clusters FindClusters(const TileMesh& mesh, int depth, const Eigen::Vector3d& low, double cell_size) {
  Clusters clusters;
  absl::flat_hash_map<Cell, uint32_t> number_of_cell;
  for (size_t v = 0; v < mesh.positions.size(); ++v) {
    auto number = static_cast<uint32_t>(clusters.count);
    if (mesh.common_depth[v] >= depth) {
      const Eigen::Vector3d in_cells = (mesh.positions[v].cast<double>() - low) / cell_size;
      const Cell cell = {std::llround(std::floor(in_cells.x())), std::llround(std::floor(in_cells.y())),
                         std::llround(std::floor(in_cells.z()))};
      number = number_of_cell.try_emplace(cell, number).first->second;
    }
    if (number == clusters.count) ++clusters.count;
    clusters.of_vertex.push_back(number);
  }
  return clusters;
}

// Faces whose corners are in three clusters, each once.
std::vector<Face> ClusteredFaces(const TileMesh& mesh, const Clusters& clusters) {
  std::vector<Face> faces;
  for (const Face& face : mesh.faces) {
    Face corners = {clusters.of_vertex[face[0]], clusters.of_vertex[face[1]], clusters.of_vertex[face[2]]};
    if (corners[0] == corners[1] || corners[1] == corners[2] || corners[2] == corners[0]) continue;
    std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
    faces.push_back(corners);
  }
  std::sort(faces.begin(), faces.end());
  faces.erase(std::unique(faces.begin(), faces.end()), faces.end());
  return faces;
}

// One vertex for each cluster, at the mean, and how far the farthest of those it stands for is.
TileMesh Means(const TileMesh& mesh, const Clusters& clusters) {
  std::vector<Eigen::Vector3d> position_sums(clusters.count, Eigen::Vector3d::Zero());
  std::vector<Eigen::Vector3d> color_sums(clusters.count, Eigen::Vector3d::Zero());
  std::vector<int> counts(clusters.count, 0);
  TileMesh means;
  for (size_t v = 0; v < mesh.positions.size(); ++v) {
    const uint32_t cluster = clusters.of_vertex[v];
    position_sums[cluster] += mesh.positions[v].cast<double>();
    if (!mesh.colors.empty()) {
      const auto& color = mesh.colors[v];
      color_sums[cluster] += Eigen::Vector3d(color[0], color[1], color[2]);
    }
    if (++counts[cluster] == 1) CopyVertex(mesh, v, means);
  }
  for (size_t i = 0; i < clusters.count; ++i) {
    if (counts[i] == 1) continue;
    means.positions[i] = (position_sums[i] / counts[i]).cast<float>();
    means.vertices[i] = TileMesh::kNoVertex;
    if (mesh.colors.empty()) continue;
    for (int k = 0; k < 3; ++k) {
      means.colors[i][static_cast<size_t>(k)] = static_cast<uint8_t>(std::lround(color_sums[i][k] / counts[i]));
    }
  }
  double moved = 0;
  for (size_t v = 0; v < mesh.positions.size(); ++v) {
    const Eigen::Vector3f& mean = means.positions[clusters.of_vertex[v]];
    moved = std::max(moved, (mean.cast<double>() - mesh.positions[v].cast<double>()).norm());
  }
  means.box = mesh.box;
  means.error = mesh.error + moved;
  return means;
}

// Leaves out vertices that no face has.
TileMesh WithoutLooseVertices(const TileMesh& mesh) {
  TileMesh kept;
  kept.box = mesh.box;
  kept.error = mesh.error;
  std::vector<uint32_t> places(mesh.positions.size(), TileMesh::kNoVertex);
  for (const Face& face : mesh.faces) {
    Face corners = {};
    for (size_t k = 0; k < 3; ++k) {
      uint32_t& place = places[face[k]];
      if (place == TileMesh::kNoVertex) place = CopyVertex(mesh, face[k], kept);
      corners[k] = place;
    }
    kept.faces.push_back(corners);
  }
  return kept;
}

}  // namespace

TileMesh LeafMesh(const MeshRows& mesh, const TileTree& tree, const Tile& leaf) {
  TileMesh tile;
  absl::flat_hash_map<uint32_t, uint32_t> places;
  for (size_t i = leaf.begin; i < leaf.end; ++i) {
    Face corners = mesh.Face(tree.FaceAt(i));
    for (uint32_t& corner : corners) {
      const uint32_t vertex = corner;
      corner = places.try_emplace(vertex, static_cast<uint32_t>(tile.positions.size())).first->second;
      if (corner < tile.positions.size()) continue;
      tile.positions.push_back(mesh.Position(vertex));
      if (mesh.has_colors()) tile.colors.push_back(mesh.Color(vertex));
      tile.vertices.push_back(vertex);
      tile.common_depth.push_back(static_cast<uint8_t>(tree.CommonDepth(vertex)));
      tile.box.extend(tile.positions.back().cast<double>());
    }
    tile.faces.push_back(corners);
  }
  return tile;
}

TileMesh ParentMesh(const std::vector<TileMesh>& children, const TileTree& tree, const Tile& parent, size_t max_faces) {
  constexpr double kFinest = 1.0 / 256;  // of the cube; a plane through it then has twice 256 * 256 faces
  constexpr double kCoarsest = 1.0 / 8;
  const TileMesh joined = Join(children);
  double cell = kFinest;
  while (true) {
    const Clusters clusters = FindClusters(joined, parent.depth, tree.low(), cell * tree.CubeSize(parent.depth));
    std::vector<Face> faces = ClusteredFaces(joined, clusters);
    if (faces.size() <= max_faces || cell >= kCoarsest) {
      TileMesh means = Means(joined, clusters);
      means.faces = std::move(faces);
      return WithoutLooseVertices(means);
    }
    cell *= std::sqrt(2.0);
  }
}

std::vector<Eigen::Vector3f> SnappedPositions(const TileMesh& mesh, const TileTree& tree, const Tile& tile) {
  std::vector<Eigen::Vector3f> snapped;
  for (size_t v = 0; v < mesh.positions.size(); ++v) {
    const double step = tree.LatticeStep(std::min(tile.depth, mesh.common_depth[v] + 1));
    const Eigen::Vector3d multiples = (mesh.positions[v].cast<double>() / step).array().round();
    snapped.push_back((multiples * step).cast<float>());
  }
  return snapped;
}

}  // namespace meshwright
