// SPDX-License-Identifier: Apache-2.0
#include "pipeline/texturing/face_graph.h"

#include <algorithm>

namespace meshwright {
namespace {

struct Side {
  uint32_t low = 0;
  uint32_t high = 0;
  int32_t face = 0;

  friend auto operator<=>(const Side&, const Side&) = default;
};

}  // namespace

std::vector<InnerEdge> FindInnerEdges(const TriangleMesh& mesh) {
  std::vector<Side> sides;
  sides.reserve(3 * mesh.faces.size());
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    for (size_t k = 0; k < 3; ++k) {
      const auto [low, high] = std::minmax(mesh.faces[f][k], mesh.faces[f][(k + 1) % 3]);
      sides.push_back({low, high, static_cast<int32_t>(f)});
    }
  }
  std::ranges::sort(sides);
  std::vector<InnerEdge> edges;
  for (size_t i = 1; i < sides.size(); ++i) {
    const Side& a = sides[i - 1];
    const Side& b = sides[i];
    if (a.low == b.low && a.high == b.high) edges.push_back({{a.low, a.high}, {a.face, b.face}});
  }
  return edges;
}

}  // namespace meshwright
