// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/mesh_simplification.h"

#include <algorithm>
#include <cstddef>
#include <iterator>

#include <meshoptimizer.h>

#include "common/base/check.h"
#include "common/mesh/disjoint_sets.h"

namespace meshwright {
namespace {

using Face = std::array<uint32_t, 3>;
using Edge = std::pair<uint32_t, uint32_t>;  // from, to

// One side of a triangle.
struct HalfEdge {
  Edge edge;
  int32_t corner = 0;  // 3 * face + the corner it starts from

  friend auto operator<=>(const HalfEdge&, const HalfEdge&) = default;
};

std::vector<HalfEdge> SortedHalfEdges(const std::vector<Face>& faces) {
  std::vector<HalfEdge> half_edges;
  half_edges.reserve(3 * faces.size());
  for (size_t f = 0; f < faces.size(); ++f) {
    for (size_t k = 0; k < 3; ++k) {
      half_edges.push_back({.edge = {faces[f][k], faces[f][(k + 1) % 3]}, .corner = static_cast<int32_t>(3 * f + k)});
    }
  }
  std::ranges::sort(half_edges);
  return half_edges;
}

// The first half edge that runs the other way; null: none.
const HalfEdge* FindOpposite(const std::vector<HalfEdge>& sorted, const Edge& edge) {
  const Edge opposite(edge.second, edge.first);
  const auto it = std::ranges::lower_bound(sorted, opposite, {}, &HalfEdge::edge);
  return it != sorted.end() && it->edge == opposite ? &*it : nullptr;
}

// Edges with one triangle, ascending.
std::vector<Edge> OpenEdges(const std::vector<HalfEdge>& sorted) {
  std::vector<Edge> open;
  for (const HalfEdge& half_edge : sorted) {
    if (FindOpposite(sorted, half_edge.edge) == nullptr) open.push_back(half_edge.edge);
  }
  return open;
}

// What has to hold for simplified faces, remembered of those before.
class Topology {
 public:
  Topology(const std::vector<Face>& faces, std::vector<Edge> other_edges)
      : open_edges_(OpenEdges(SortedHalfEdges(faces))), other_edges_(std::move(other_edges)) {
    std::ranges::sort(other_edges_);
  }

  // Marks vertices at which it does not hold.
  void MarkFaults(const std::vector<Face>& faces, std::vector<uint8_t>& faulty) const {
    const auto mark = [&](const Edge& edge) { faulty[edge.first] = faulty[edge.second] = 1; };
    const std::vector<HalfEdge> sorted = SortedHalfEdges(faces);
    for (size_t i = 0; i < sorted.size(); ++i) {
      const Edge& edge = sorted[i].edge;
      if ((i > 0 && sorted[i - 1].edge == edge) || std::ranges::binary_search(other_edges_, edge)) mark(edge);
    }
    std::vector<Edge> changed;
    std::ranges::set_symmetric_difference(OpenEdges(sorted), open_edges_, std::back_inserter(changed));
    std::ranges::for_each(changed, mark);
    MarkPoints(faces, sorted, faulty);
  }

 private:
  // Marks vertices where fans meet in a point.
  static void MarkPoints(const std::vector<Face>& faces, const std::vector<HalfEdge>& sorted,
                         std::vector<uint8_t>& faulty) {
    const auto next = [](int32_t corner) { return corner % 3 == 2 ? corner - 2 : corner + 1; };
    DisjointSets fans(3 * faces.size());
    for (const HalfEdge& half_edge : sorted) {
      const HalfEdge* opposite = FindOpposite(sorted, half_edge.edge);
      if (opposite != nullptr) fans.Join(half_edge.corner, next(opposite->corner));
    }
    constexpr int32_t kNone = -1;
    std::vector<int32_t> fan_of_vertex(faulty.size(), kNone);
    for (size_t f = 0; f < faces.size(); ++f) {
      for (size_t k = 0; k < 3; ++k) {
        const int32_t fan = fans.Root(static_cast<int32_t>(3 * f + k));
        int32_t& first = fan_of_vertex[faces[f][k]];
        if (first == kNone) first = fan;
        if (first != fan) faulty[faces[f][k]] = 1;
      }
    }
  }

  std::vector<Edge> open_edges_;
  std::vector<Edge> other_edges_;
};

// Quadrics alone: the library keeps borders, but may let other edges meet.
std::vector<Face> Collapse(const std::vector<Eigen::Vector3f>& positions, const std::vector<Face>& faces,
                           double max_error) {
  static_assert(sizeof(Eigen::Vector3f) == 3 * sizeof(float) && sizeof(Face) == 3 * sizeof(unsigned int));
  constexpr size_t kStride = sizeof(Eigen::Vector3f);
  const float scale = faces.empty() ? 0 : meshopt_simplifyScale(positions.front().data(), positions.size(), kStride);
  if (!(scale > 0)) return faces;
  std::vector<Face> collapsed(faces.size());
  const size_t indices = meshopt_simplify(collapsed.front().data(), faces.front().data(), 3 * faces.size(),
                                          positions.front().data(), positions.size(), kStride, 0,
                                          static_cast<float>(max_error / scale), meshopt_SimplifyLockBorder, nullptr);
  collapsed.resize(indices / 3);
  return collapsed;
}

}  // namespace

std::vector<Face> SimplifyFaces(const std::vector<Eigen::Vector3f>& positions, const std::vector<Face>& faces,
                                double max_error, const std::vector<Edge>& other_edges) {
  MW_CHECK(max_error >= 0);
  const Topology topology(faces, other_edges);
  // Where collapsing did harm, the triangles stay as they are and it is tried again around them. In the end that would
  // be all of them, so it ends.
  std::vector<uint8_t> untouched(positions.size(), 0);
  while (true) {
    std::vector<Face> stay;
    std::vector<Face> collapse;
    for (const Face& face : faces) {
      const bool stays = std::ranges::any_of(face, [&](uint32_t v) { return untouched[v] != 0; });
      (stays ? stay : collapse).push_back(face);
    }
    std::vector<Face> simplified = Collapse(positions, collapse, max_error);
    simplified.insert(simplified.end(), stay.begin(), stay.end());
    std::vector<uint8_t> harmed = untouched;
    topology.MarkFaults(simplified, harmed);
    if (harmed == untouched) return simplified;
    untouched = std::move(harmed);
  }
}

}  // namespace meshwright
