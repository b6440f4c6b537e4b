// SPDX-License-Identifier: Apache-2.0
// What BorderStitcher does about gaps that no front closes: triangles that are known otherwise, and loops of whatever
// shape.
#include <algorithm>
#include <cmath>
#include <functional>
#include <queue>
#include <tuple>

#include <Eigen/Geometry>
#include <absl/container/flat_hash_map.h>

#include "common/mesh/border_stitching.h"

namespace meshwright {
namespace {

// Larger loops are left alone: time grows with the third power of the corners.
constexpr size_t kMaxSlitCorners = 60;
// Of a triangle that touches what is there in points, beside its longest edge: no rays say anything against a hair.
constexpr double kMinHeight = 0.1;

}  // namespace

std::pair<int32_t, int32_t> BorderStitcher::PlaceFor(const Face& triangle) const {
  for (size_t k = 0; k < 3; ++k) {
    // A triangle runs along an open edge from its end to its start.
    const int32_t b = triangle[k];
    const int32_t a = triangle[(k + 1) % 3];
    const int32_t c = triangle[(k + 2) % 3];
    const Eigen::Vector3d normal = (Position(a) - Position(b)).cross(Position(c) - Position(b));
    if (!(normal.dot(Normal(a) + Normal(b) + Normal(c)) > 0)) continue;  // it would fold over
    for (int32_t edge = a; edge >= 0; edge = At(edge).sibling) {
      if (!At(edge).open || VertexOf(At(edge).next) != b) continue;
      for (int32_t corner = c; corner >= 0; corner = At(corner).sibling) {
        if (!At(corner).open) continue;
        const bool after = At(At(edge).next).next == corner;
        const bool before = At(edge).previous == corner;
        if (!MakesNewEdges(edge, corner)) continue;
        // Which of several gaps it lies in is to be seen; a vertex with one has no choice, however its rim is turned.
        const bool has_choice = open_at_vertex_[static_cast<size_t>(c)] > 1 && !after && !before;
        if (!has_choice || FitsGaps(edge, corner, {})) return {edge, corner};
      }
    }
  }
  return {-1, -1};
}

double BorderStitcher::SquaredLength(const Face& triangle) const {
  double longest = 0;
  for (size_t k = 0; k < 3; ++k) {
    longest = std::max(longest, (Position(triangle[k]) - Position(triangle[(k + 1) % 3])).squaredNorm());
  }
  return longest;
}

std::vector<BorderStitcher::Face> BorderStitcher::SmallestFirst(absl::Span<const Face> triangles) const {
  std::vector<std::pair<double, size_t>> by_size;
  for (size_t i = 0; i < triangles.size(); ++i) by_size.emplace_back(SquaredLength(triangles[i]), i);
  std::ranges::sort(by_size);
  std::vector<Face> sorted;
  for (const auto& [longest, i] : by_size) sorted.push_back(triangles[i]);
  return sorted;
}

int64_t BorderStitcher::SewOn(absl::Span<const Face> triangles) {
  const std::vector<Face> by_size = SmallestFirst(triangles);
  absl::flat_hash_map<std::pair<int32_t, int32_t>, std::vector<size_t>> at_edge;  // ranks, by undirected edges
  std::priority_queue<size_t, std::vector<size_t>, std::greater<>> ranks;
  for (size_t rank = 0; rank < by_size.size(); ++rank) {
    const Face& triangle = by_size[rank];
    for (size_t k = 0; k < 3; ++k) {
      at_edge[std::minmax(triangle[k], triangle[(k + 1) % 3])].push_back(rank);
    }
    ranks.push(rank);
  }
  std::vector<uint8_t> is_sewn(triangles.size(), 0);
  std::vector<int32_t> changed;
  int64_t count = 0;
  while (!ranks.empty()) {
    const size_t rank = ranks.top();
    ranks.pop();
    if (is_sewn[rank] != 0) continue;
    const auto [edge, corner] = PlaceFor(by_size[rank]);
    if (edge < 0) continue;
    Apply(edge, corner, changed);
    is_sewn[rank] = 1;
    ++count;
    // What lies along its edges may have its place now.
    for (const int32_t open : changed) {
      if (!At(open).open) continue;
      const auto waiting = at_edge.find(std::minmax(VertexOf(open), VertexOf(At(open).next)));
      if (waiting == at_edge.end()) continue;
      for (const size_t other : waiting->second) {
        if (is_sewn[other] == 0) ranks.push(other);
      }
    }
  }
  return count;
}

int64_t BorderStitcher::PutIn(absl::Span<const Face> triangles) {
  int64_t count = 0;
  for (const Face& triangle : SmallestFirst(triangles)) {
    const auto& [a, b, c] = triangle;
    if (!IsOpen(a) || !IsOpen(b) || !IsOpen(c)) continue;
    if (HasEdge(a, b) || HasEdge(b, c) || HasEdge(c, a)) continue;
    const Eigen::Vector3d normal = (Position(b) - Position(a)).cross(Position(c) - Position(a));
    if (!(normal.dot(Normal(a) + Normal(b) + Normal(c)) > 0)) continue;  // it would fold over
    if (normal.norm() < kMinHeight * SquaredLength(triangle)) continue;
    const auto first = static_cast<int32_t>(corners_.size());
    for (int32_t k = 0; k < 3; ++k) {
      const int32_t v = triangle[static_cast<size_t>(k)];
      corners_.push_back(
          {.vertex = v, .previous = first + (k + 2) % 3, .next = first + (k + 1) % 3, .sibling = At(v).sibling});
      At(v).sibling = first + k;
      ++open_at_vertex_[static_cast<size_t>(v)];
    }
    AddFace(triangle);
    ++count;
  }
  return count;
}

void BorderStitcher::SortGapsAround(int32_t v) {
  const Eigen::Vector3d x = Position(v);
  const Eigen::Vector3d x_axis = Normal(v).unitOrthogonal();
  const Eigen::Vector3d y_axis = Normal(v).cross(x_axis);
  // Counter-clockwise around the normal a gap runs from the edge that comes in to the one that goes out.
  struct End {
    double angle = 0;
    bool goes_out = false;
    int32_t edge = 0;
  };
  std::vector<End> ends;
  const auto add = [&](int32_t towards, bool goes_out, int32_t edge) {
    const Eigen::Vector3d d = Position(towards) - x;
    ends.push_back({std::atan2(d.dot(y_axis), d.dot(x_axis)), goes_out, edge});
  };
  for (int32_t corner = v; corner >= 0; corner = At(corner).sibling) {
    if (!At(corner).open) continue;
    add(VertexOf(At(corner).previous), false, At(corner).previous);
    add(VertexOf(At(corner).next), true, corner);
  }
  std::ranges::sort(ends, {}, [](const End& end) { return std::tuple(end.angle, end.goes_out, end.edge); });
  // As brackets around a circle: those that cross the angle where counting begins find their ends on the second turn.
  std::vector<std::pair<int32_t, int32_t>> gaps;
  std::vector<int32_t> coming_in;
  std::vector<End> left;
  for (int turn = 0; turn < 2; ++turn) {
    for (const End& end : turn == 0 ? ends : left) {
      if (!end.goes_out) {
        coming_in.push_back(end.edge);
      } else if (!coming_in.empty()) {
        gaps.emplace_back(coming_in.back(), end.edge);
        coming_in.pop_back();
      } else {
        left.push_back(end);
      }
    }
  }
  for (const auto& [in, out] : gaps) {
    At(out).previous = in;
    At(in).next = out;
  }
}

void BorderStitcher::CutLoops() {
  SpooledVector<uint8_t> seen(spool_beside_);
  seen.assign(corners_.size(), 0);
  SpooledVector<int32_t> corner_at(spool_beside_);  // per vertex, of the loop that is walked along
  corner_at.assign(vertices_.size(), kNone);
  const auto leave = [&](int32_t corner) {
    seen[static_cast<size_t>(corner)] = 1;
    corner_at[static_cast<size_t>(VertexOf(corner))] = kNone;
  };
  for (size_t i = 0; i < corners_.size(); ++i) {
    if (!corners_[i].open || seen[i] != 0) continue;
    auto first = static_cast<int32_t>(i);
    auto corner = first;
    do {
      int32_t& met = corner_at[static_cast<size_t>(VertexOf(corner))];
      if (met != kNone) {
        // What has come back to the vertex becomes a loop of its own.
        const int32_t start = met;
        const int32_t last = At(corner).previous;
        const int32_t before = At(start).previous;
        At(before).next = corner;
        At(corner).previous = before;
        At(last).next = start;
        At(start).previous = last;
        for (int32_t cut = At(start).next; cut != start; cut = At(cut).next) leave(cut);
        leave(start);
        if (start == first) first = corner;
      }
      met = corner;
      corner = At(corner).next;
    } while (corner != first);
    leave(first);
    for (int32_t rest = At(first).next; rest != first; rest = At(rest).next) leave(rest);
  }
}

bool BorderStitcher::IsIsland(absl::Span<const int32_t> loop) const {
  Eigen::Vector3d area = Eigen::Vector3d::Zero();
  Eigen::Vector3d normals = Eigen::Vector3d::Zero();
  const Eigen::Vector3d x = Position(VertexOf(loop.front()));
  for (const int32_t corner : loop) {
    if (last_at_vertex_[static_cast<size_t>(VertexOf(corner))] != kEnd) return false;
    area += (Position(VertexOf(corner)) - x).cross(Position(VertexOf(At(corner).next)) - x);
    normals += Normal(VertexOf(corner));
  }
  return area.dot(normals) > 0;
}

int32_t BorderStitcher::FaceWithin(absl::Span<const int32_t> loop) const {
  if (loop.size() != 3) return kNone;
  const int32_t face = FaceAlong(VertexOf(loop[0]), VertexOf(loop[1]));
  if (face == kNone) return kNone;
  return std::ranges::count(faces_[static_cast<size_t>(face)], VertexOf(loop[2])) > 0 ? face : kNone;
}

int64_t BorderStitcher::CloseSlits(double max_width) {
  for (const int32_t v : VerticesThatHadSeveralGaps()) SortGapsAround(v);
  CutLoops();
  Release();
  SpooledVector<uint8_t> seen(spool_beside_);
  seen.assign(corners_.size(), 0);
  std::vector<int32_t> loop;
  int64_t count = 0;
  for (size_t i = 0; i < corners_.size(); ++i) {
    if (!corners_[i].open || seen[i] != 0) continue;
    loop.clear();
    Eigen::Vector3d center = Eigen::Vector3d::Zero();
    double spacing = 0;
    for (auto corner = static_cast<int32_t>(i); seen[static_cast<size_t>(corner)] == 0; corner = At(corner).next) {
      seen[static_cast<size_t>(corner)] = 1;
      if (loop.size() > kMaxSlitCorners) continue;
      loop.push_back(corner);
      center += Position(VertexOf(corner));
      spacing += Vertex(VertexOf(corner)).spacing;
    }
    if (loop.size() > kMaxSlitCorners) continue;
    if (const int32_t face = FaceWithin(loop); face != kNone) {
      for (const int32_t corner : loop) Close(At(corner));
      faces_alone_.push_back(face);
      continue;
    }
    center /= static_cast<double>(loop.size());
    spacing /= static_cast<double>(loop.size());
    const bool is_narrow = std::ranges::all_of(
        loop, [&](int32_t corner) { return 2 * (Position(VertexOf(corner)) - center).norm() <= max_width * spacing; });
    if (!is_narrow || IsIsland(loop)) continue;
    CloseLoops(loop, LoopFill::kByArea);
    if (!At(loop.front()).open) ++count;
  }
  std::ranges::sort(faces_alone_);
  return count;
}

}  // namespace meshwright
