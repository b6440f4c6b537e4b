// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/border_stitching.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <mutex>
#include <queue>
#include <tuple>

#include <Eigen/Geometry>
#include <absl/container/flat_hash_set.h>

#include "common/base/check.h"
#include "common/mesh/loop_triangulation.h"

namespace meshwright {
namespace {

// A triangle across a seam climbs the parts' difference in depth, so it may lean more than the parts themselves do.
constexpr double kMinSeamNormalCosine = 0.3;
// In a hole triangles keep to the hole's plane.
constexpr double kMinHoleNormalCosine = 0.2;
// A hole this narrow is a crack in one surface, however its rim is turned. Times the spacing.
constexpr double kSlitWidth = 6;
constexpr double kMinSlitCosine = 0.05;
// So many of a wider hole's rim vertices must lie near its plane.
constexpr double kMinFlatShare = 0.9;
// What is left of a hole is closed at once when it has no more corners; in a larger one the rims are too wild.
constexpr size_t kMaxLoopCorners = 60;
// Vertices whose normals differ more belong to another sheet.
constexpr double kMinSheetCosine = 0.5;

double Cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

// How far around a block, as a share of its longest side, vertices are sorted into grids; what edges further away need
// is looked for one by one.
constexpr double kMargin = 0.1;
// Edges that one thread looks at before it takes the next ones, and triangles between two looks at how far it is.
constexpr int64_t kEdgesAtOnce = 1024;
constexpr size_t kPopsAStep = 4096;
// What is done before memory is given back.
constexpr size_t kHolesAtOnce = 4096;
constexpr size_t kCornersAtOnce = 65536;
// Of BorderStitcher::kSteps, by the time that they take.
constexpr int kStepsOfStitching = 50;

// Calls `step` as often as a share of `total` asks for that is reached. Thread-safe.
class Steps {
 public:
  Steps(int total, const std::function<void()>& step) : total_(total), step_(step) {}

  void Reach(double share) {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (; done_ < static_cast<int>(share * total_); ++done_) step_();
  }

 private:
  const int total_;
  const std::function<void()>& step_;
  std::mutex mutex_;
  int done_ = 0;
};

// radius < 2^level.
int LevelOf(double radius) {
  int level = 0;
  std::frexp(radius, &level);
  return level;
}

std::array<int32_t, 3> CellOf(const Eigen::Vector3d& x, double width) {
  std::array<int32_t, 3> cell = {};
  for (int k = 0; k < 3; ++k) {
    // Far beyond any scene the cells melt into one; that costs time only.
    cell[static_cast<size_t>(k)] = static_cast<int32_t>(std::clamp(std::floor(x[k] / width), -1e9, 1e9));
  }
  return cell;
}

// Whether the open segments meet in one point that is inside both.
bool Cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& p, const Eigen::Vector2d& q) {
  const double p_side = Cross(b - a, p - a);
  const double q_side = Cross(b - a, q - a);
  const double a_side = Cross(q - p, a - p);
  const double b_side = Cross(q - p, b - p);
  return ((p_side > 0) != (q_side > 0)) && ((a_side > 0) != (b_side > 0)) && p_side != 0 && q_side != 0 &&
         a_side != 0 && b_side != 0;
}

// Whether direction d lies in the sector that runs counter-clockwise about `normal` from `first` to `last`.
bool InSector(const Eigen::Vector3d& normal, const Eigen::Vector3d& first, const Eigen::Vector3d& d,
              const Eigen::Vector3d& last) {
  const auto turn = [&](const Eigen::Vector3d& from, const Eigen::Vector3d& to) { return normal.dot(from.cross(to)); };
  if (turn(first, last) >= 0) return turn(first, d) >= 0 && turn(d, last) >= 0;
  return !(turn(last, d) > 0 && turn(d, first) > 0);
}

}  // namespace

// Plane along an open edge in which its neighbourhood is looked at: x along the edge, y away from its triangle.
struct BorderStitcher::EdgeFrame {
  Eigen::Vector3d a, b, normal, x_axis, y_axis;
  int32_t a_vertex = 0;
  int32_t b_vertex = 0;
  Eigen::Vector2d Project(const Eigen::Vector3d& x) const { return {(x - a).dot(x_axis), (x - a).dot(y_axis)}; }
};

BorderStitcher::BorderStitcher(absl::Span<const BorderVertex> vertices,
                               absl::Span<const std::pair<int32_t, int32_t>> inner_edges,
                               const std::string& spool_beside)
    : vertices_(vertices),
      inner_edges_(inner_edges),
      spool_beside_(spool_beside),
      previous_in_part_(spool_beside),
      first_inner_edge_(spool_beside),
      corners_(spool_beside),
      open_at_vertex_(spool_beside),
      faces_(spool_beside),
      last_at_vertex_(spool_beside),
      one_before_(spool_beside) {
  open_at_vertex_.assign(vertices_.size(), 1);
  last_at_vertex_.assign(vertices_.size(), kEnd);
  previous_in_part_.assign(vertices_.size(), kNone);
  corners_.assign(vertices_.size(), {});
  size_t edge = 0;
  for (size_t v = 0; v < vertices_.size(); ++v) {
    const int32_t next = vertices_[v].next;
    corners_[v].vertex = static_cast<int32_t>(v);
    corners_[v].next = next;
    At(next).previous = static_cast<int32_t>(v);
    previous_in_part_[static_cast<size_t>(next)] = static_cast<int32_t>(v);
    first_inner_edge_.push_back(static_cast<int32_t>(edge));
    if (v % kCornersAtOnce == 0) Release();
    for (; edge < inner_edges.size() && inner_edges[edge].first == static_cast<int32_t>(v); ++edge) {
      MW_CHECK(inner_edges[edge].second > static_cast<int32_t>(v));
    }
  }
  MW_CHECK(edge == inner_edges.size());
  first_inner_edge_.push_back(static_cast<int32_t>(edge));
}

bool BorderStitcher::IsBlocked(absl::Span<const Segment> blockers, const Segment& segment) {
  return std::ranges::any_of(blockers, [&](const Segment& s) {
    return s.from_vertex != segment.from_vertex && s.from_vertex != segment.to_vertex &&
           s.to_vertex != segment.from_vertex && s.to_vertex != segment.to_vertex &&
           Cross(segment.from, segment.to, s.from, s.to);
  });
}

bool BorderStitcher::HasEdge(int32_t v, int32_t w) const {
  if (Vertex(v).next == w || Vertex(w).next == v) return true;
  const auto [low, high] = std::minmax(v, w);
  const auto at = static_cast<size_t>(low);
  for (int32_t edge = first_inner_edge_[at]; edge < first_inner_edge_[at + 1]; ++edge) {
    if (inner_edges_[static_cast<size_t>(edge)].second == high) return true;
  }
  for (uint32_t entry = last_at_vertex_[at]; entry != kEnd; entry = one_before_[entry]) {
    const Face& face = faces_[entry / 3];
    if (std::ranges::find(face, high) != face.end()) return true;
  }
  return false;
}

void BorderStitcher::AddFace(const Face& face) {
  for (size_t k = 0; k < 3; ++k) {
    uint32_t& last = last_at_vertex_[static_cast<size_t>(face[k])];
    one_before_.push_back(last);
    last = static_cast<uint32_t>(3 * faces_.size() + k);
  }
  MW_CHECK(one_before_.size() < kEnd);
  faces_.push_back(face);
}

int32_t BorderStitcher::FaceAlong(int32_t from, int32_t to) const {
  for (uint32_t entry = last_at_vertex_[static_cast<size_t>(from)]; entry != kEnd; entry = one_before_[entry]) {
    if (faces_[entry / 3][(entry + 1) % 3] == to) return static_cast<int32_t>(entry / 3);
  }
  return kNone;
}

std::vector<int32_t> BorderStitcher::FacesAround(int32_t v) const {
  std::vector<int32_t> found;
  for (uint32_t entry = last_at_vertex_[static_cast<size_t>(v)]; entry != kEnd; entry = one_before_[entry]) {
    found.push_back(static_cast<int32_t>(entry / 3));
  }
  std::ranges::reverse(found);
  return found;
}

void BorderStitcher::Release() const {
  previous_in_part_.Release();
  first_inner_edge_.Release();
  corners_.Release();
  open_at_vertex_.Release();
  faces_.Release();
  last_at_vertex_.Release();
  one_before_.Release();
}

int64_t BorderStitcher::CountOpenEdges() const {
  return std::ranges::count_if(corners_, [](const Corner& corner) { return corner.open; });
}

std::vector<int32_t> BorderStitcher::VerticesThatHadSeveralGaps() const {
  std::vector<int32_t> found;
  for (size_t v = 0; v < vertices_.size(); ++v) {
    if (corners_[v].sibling >= 0) found.push_back(static_cast<int32_t>(v));
  }
  return found;
}

void BorderStitcher::Drop(const std::function<bool(int32_t)>& is_dropped) {
  for (Corner& corner : corners_) {
    if (corner.open && is_dropped(corner.vertex)) Close(corner);
  }
}

void BorderStitcher::Close(Corner& corner) {
  corner.open = false;
  --open_at_vertex_[static_cast<size_t>(corner.vertex)];
}

void BorderStitcher::MakeGrid(int level) {
  const auto [grid, is_new] = grids_.try_emplace(level);
  if (!is_new) return;
  const double width = std::ldexp(1.0, level);
  for (const int32_t v : members_) {
    if (open_at_vertex_[static_cast<size_t>(v)] > 0 && Vertex(v).spacing <= width) {
      grid->second[CellOf(Position(v), width)].push_back(v);
    }
  }
}

// The grid of LevelOf(radius) is there. As long as no vertex has lost its last open corner since that was made, nothing
// is written, and several threads may call at the same time.
void BorderStitcher::FindNearby(const Eigen::Vector3d& x, double radius, std::vector<int32_t>& found) {
  const int level = LevelOf(radius);
  const double width = std::ldexp(1.0, level);
  const Eigen::AlignedBox3d box(x - Eigen::Vector3d::Constant(radius), x + Eigen::Vector3d::Constant(radius));
  if (!near_block_.contains(box)) {
    found = blocks_->PointsIn(box);
    std::erase_if(found, [&](int32_t v) {
      return open_at_vertex_[static_cast<size_t>(v)] == 0 || Vertex(v).spacing > width ||
             !((Position(v) - x).squaredNorm() <= radius * radius);
    });
    return;
  }
  auto& grid = grids_.at(level);
  found.clear();
  const std::array<int32_t, 3> low = CellOf(x - Eigen::Vector3d::Constant(radius), width);
  const std::array<int32_t, 3> high = CellOf(x + Eigen::Vector3d::Constant(radius), width);
  std::array<int32_t, 3> at = low;
  for (at[2] = low[2]; at[2] <= high[2]; ++at[2]) {
    for (at[1] = low[1]; at[1] <= high[1]; ++at[1]) {
      for (at[0] = low[0]; at[0] <= high[0]; ++at[0]) {
        const auto cell = grid.find(at);
        if (cell == grid.end()) continue;
        std::vector<int32_t>& members = cell->second;
        for (size_t m = 0; m < members.size();) {
          const int32_t v = members[m];
          if (open_at_vertex_[static_cast<size_t>(v)] == 0) {  // never again
            members[m] = members.back();
            members.pop_back();
            continue;
          }
          if ((Position(v) - x).squaredNorm() <= radius * radius) found.push_back(v);
          ++m;
        }
      }
    }
  }
}

// Whether the edge from the corner's vertex to `vertex` starts in the corner's gap.
bool BorderStitcher::InGap(int32_t corner, int32_t vertex, const Scope& scope) const {
  const Corner& at = At(corner);
  const int32_t previous = VertexOf(at.previous);
  const int32_t next = VertexOf(at.next);
  if (vertex == previous || vertex == next) return true;
  const Eigen::Vector3d x = Position(at.vertex);
  return InSector(NormalFor(at.vertex, scope), Position(previous) - x, Position(vertex) - x, Position(next) - x);
}

bool BorderStitcher::MakesNewEdges(int32_t edge, int32_t corner) const {
  const int32_t end = At(edge).next;
  const int32_t c = VertexOf(corner);
  const bool after = At(end).next == corner;
  const bool before = At(edge).previous == corner;
  return (after || !HasEdge(VertexOf(end), c)) && (before || !HasEdge(VertexOf(edge), c));
}

bool BorderStitcher::FitsGaps(int32_t edge, int32_t corner, const Scope& scope) const {
  const int32_t end = At(edge).next;
  const int32_t a = VertexOf(edge);
  const int32_t b = VertexOf(end);
  const int32_t c = VertexOf(corner);
  const bool after = At(end).next == corner;
  const bool before = At(edge).previous == corner;
  if (!MakesNewEdges(edge, corner)) return false;
  if (!before && !InGap(edge, c, scope)) return false;
  if (!after && !InGap(end, c, scope)) return false;
  if (!before && !InGap(corner, a, scope)) return false;
  if (!after && !InGap(corner, b, scope)) return false;
  if (before || after) return true;
  // Counter-clockwise around c: its previous vertex, b, a, its next vertex.
  const Eigen::Vector3d x = Position(c);
  const Eigen::Vector3d next = Position(VertexOf(At(corner).next));
  return InSector(NormalFor(c, scope), Position(b) - x, Position(a) - x, next - x);
}

bool BorderStitcher::Fits(const EdgeFrame& frame, int32_t edge, int32_t corner, const Scope& scope,
                          const Scratch& scratch) const {
  const int32_t c = VertexOf(corner);
  const Eigen::Vector3d x = Position(c);
  const Eigen::Vector3d normal = (frame.a - frame.b).cross(x - frame.b).normalized();
  for (const int32_t v : {frame.a_vertex, frame.b_vertex, c}) {
    if (!(normal.dot(NormalFor(v, scope)) > scope.min_normal_cosine)) return false;
  }
  if (!FitsGaps(edge, corner, scope)) return false;
  const bool after = At(At(edge).next).next == corner;
  const bool before = At(edge).previous == corner;
  const Eigen::Vector2d at = frame.Project(x);
  if (!before && IsBlocked(scratch.blockers, {{0, 0}, at, frame.a_vertex, c})) return false;
  return after || !IsBlocked(scratch.blockers, {frame.Project(frame.b), at, frame.b_vertex, c});
}

// How far around the middle of an edge vertices matter.
double BorderStitcher::SearchRadius(int32_t edge, const Scope& scope) const {
  const double spacing = std::max<double>(Vertex(VertexOf(edge)).spacing, Vertex(VertexOf(At(edge).next)).spacing);
  return 2 * scope.reach * spacing;
}

BorderStitcher::Candidate BorderStitcher::BestFor(int32_t edge, const Scope& scope, Scratch& scratch) {
  EdgeFrame frame;
  frame.a_vertex = VertexOf(edge);
  frame.b_vertex = VertexOf(At(edge).next);
  frame.a = Position(frame.a_vertex);
  frame.b = Position(frame.b_vertex);
  frame.normal = (NormalFor(frame.a_vertex, scope) + NormalFor(frame.b_vertex, scope)).normalized();
  const double length = (frame.b - frame.a).norm();
  if (!(length > 0)) return {};
  frame.y_axis = (frame.b - frame.a).cross(frame.normal).normalized();
  frame.x_axis = frame.normal.cross(frame.y_axis).normalized();
  const double spacing = std::max<double>(Vertex(frame.a_vertex).spacing, Vertex(frame.b_vertex).spacing);
  const std::vector<int32_t>* around = scope.members;
  if (around == nullptr) {
    FindNearby(0.5 * (frame.a + frame.b), SearchRadius(edge, scope), scratch.nearby);
    around = &scratch.nearby;
  }

  scratch.blockers.clear();
  scratch.apexes.clear();
  for (const int32_t v : *around) {
    if (!(NormalFor(v, scope).dot(frame.normal) > kMinSheetCosine)) continue;
    const Eigen::Vector3d x = Position(v);
    const Eigen::Vector2d at = frame.Project(x);
    Apex apex = {2, 0, -1};
    if (v != frame.a_vertex && v != frame.b_vertex && at.y() > 0) {
      const Eigen::Vector3d to_a = (frame.a - x).normalized();
      const Eigen::Vector3d to_b = (frame.b - x).normalized();
      apex.cosine = to_a.dot(to_b);
      const double sine = to_a.cross(to_b).norm();
      apex.cost = (apex.cosine > 0 ? 0.5 * length / sine : 0.5 * length) / spacing;
    }
    for (int32_t corner = v; corner >= 0; corner = At(corner).sibling) {
      if (!At(corner).open) continue;
      const int32_t next = VertexOf(At(corner).next);
      const Eigen::Vector2d next_at = frame.Project(Position(next));
      if (at.y() > 0 || next_at.y() > 0) scratch.blockers.push_back({at, next_at, v, next});
      if (apex.cosine < 1 && apex.cost <= scope.reach) {
        apex.corner = corner;
        scratch.apexes.push_back(apex);
      }
    }
  }
  std::ranges::sort(scratch.apexes, {}, [](const Apex& apex) { return std::pair(apex.cosine, apex.corner); });
  for (const Apex& apex : scratch.apexes) {
    if (Fits(frame, edge, apex.corner, scope, scratch)) return {apex.cost, apex.corner};
  }
  return {};
}

// Puts the triangle over `edge` whose apex is `corner`. `changed` gets the open edges that are new or bear a new
// number.
void BorderStitcher::Apply(int32_t edge, int32_t corner, std::vector<int32_t>& changed) {
  const int32_t end = At(edge).next;
  const int32_t a = VertexOf(edge);
  const int32_t b = VertexOf(end);
  const int32_t c = VertexOf(corner);
  AddFace({b, a, c});
  const bool after = At(end).next == corner;
  const bool before = At(edge).previous == corner;
  changed.clear();
  if (after && before) {
    for (const int32_t closed : {edge, end, corner}) Close(At(closed));
  } else if (after) {
    Close(At(end));
    At(edge).next = corner;
    At(corner).previous = edge;
    changed = {edge};
  } else if (before) {
    Close(At(edge));
    At(corner).next = end;
    At(end).previous = corner;
    changed = {corner};
  } else {
    const auto twin = static_cast<int32_t>(corners_.size());
    corners_.push_back({.vertex = c, .previous = edge, .next = At(corner).next, .sibling = At(corner).sibling});
    At(corner).sibling = twin;
    ++open_at_vertex_[static_cast<size_t>(c)];
    At(At(twin).next).previous = twin;
    At(edge).next = twin;
    At(corner).next = end;
    At(end).previous = corner;
    changed = {edge, corner, twin};
  }
}

BorderStitcher::Candidate BorderStitcher::BestNow(int32_t edge, const Scope& scope) {
  if (scope.members == nullptr) MakeGrid(LevelOf(SearchRadius(edge, scope)));
  return BestFor(edge, scope, scratch_);
}

std::vector<BorderStitcher::Candidate> BorderStitcher::BestForEach(absl::Span<const int32_t> edges, const Scope& scope,
                                                                   ThreadPool& pool, const Progress& progress) {
  for (const int32_t edge : edges) {
    if (At(edge).open) MakeGrid(LevelOf(SearchRadius(edge, scope)));
  }
  std::vector<Candidate> best(edges.size());
  std::atomic<int64_t> done = 0;
  pool.ParallelFor(static_cast<int64_t>(edges.size()), kEdgesAtOnce, [&](int64_t begin, int64_t end) {
    Scratch scratch;
    for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
      if (At(edges[i]).open) best[i] = BestFor(edges[i], scope, scratch);
    }
    progress(static_cast<double>(done += end - begin) / static_cast<double>(edges.size()));
  });
  return best;
}

void BorderStitcher::Advance(absl::Span<const int32_t> edges, const Scope& scope,
                             absl::Span<const Candidate> candidates, const Progress& progress) {
  struct Entry {
    Candidate candidate;
    int32_t edge;
    int32_t next;
    bool operator<(const Entry& other) const {  // the best one is the greatest
      return std::tie(other.candidate.cost, other.edge, other.next) < std::tie(candidate.cost, edge, next);
    }
  };
  std::vector<Entry> entries;
  for (size_t i = 0; i < edges.size(); ++i) {
    if (candidates[i].corner >= 0) entries.push_back({candidates[i], edges[i], At(edges[i]).next});
  }
  std::priority_queue<Entry> queue(std::less<Entry>(), std::move(entries));
  std::vector<int32_t> changed;
  for (size_t popped = 1; !queue.empty(); ++popped) {
    if (popped % kPopsAStep == 0) {
      progress(static_cast<double>(popped) / static_cast<double>(popped + queue.size()));
    }
    const Entry top = queue.top();
    queue.pop();
    if (!At(top.edge).open || At(top.edge).next != top.next) continue;
    const Candidate best = BestNow(top.edge, scope);
    if (best.corner < 0) continue;
    if (best.cost > top.candidate.cost) {
      queue.push({best, top.edge, top.next});
      continue;
    }
    Apply(top.edge, best.corner, changed);
    for (const int32_t edge : changed) {
      if (!At(edge).open) continue;
      const Candidate next = BestNow(edge, scope);
      if (next.corner >= 0) queue.push({next, edge, At(edge).next});
    }
  }
}

void BorderStitcher::StitchBlock(const PointBlocks::Block& block, const Scope& scope, ThreadPool& pool,
                                 const Progress& looking, const Progress& stitching) {
  near_block_ = block.Grown(kMargin);
  members_ = blocks_->PointsIn(near_block_);
  // Beyond all points there is nothing to look for.
  const Eigen::AlignedBox3d& all = blocks_->around_points();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (int k = 0; k < 3; ++k) {
    if (near_block_.min()[k] <= all.min()[k]) near_block_.min()[k] = -kInfinity;
    if (near_block_.max()[k] >= all.max()[k]) near_block_.max()[k] = kInfinity;
  }
  std::vector<int32_t> edges;
  for (const int32_t v : blocks_->Points(block)) {
    for (int32_t corner = v; corner >= 0; corner = At(corner).sibling) edges.push_back(corner);
  }
  const std::vector<Candidate> candidates = BestForEach(edges, scope, pool, looking);
  Advance(edges, scope, candidates, stitching);
  grids_.clear();
}

void BorderStitcher::StitchNearby(double reach, const PointBlocks& blocks, ThreadPool& pool,
                                  const std::function<void()>& step) {
  const Scope scope = {.reach = reach, .min_normal_cosine = kMinSeamNormalCosine};
  blocks_ = &blocks;
  Steps steps(kStepsOfStitching, step);
  const auto count = static_cast<double>(blocks.blocks().size());
  double done = 0;
  for (const PointBlocks::Block& block : blocks.blocks()) {
    StitchBlock(
        block, scope, pool, [&](double share) { steps.Reach((done + 0.5 * share) / count); },
        [&](double share) { steps.Reach((done + 0.5 + 0.5 * share) / count); });
    ++done;
    blocks.Release();
    Release();
  }
  steps.Reach(1);
  blocks_ = nullptr;
  members_ = {};
}

// A loop of open edges around a hole, or the border of an island in one.
struct BorderStitcher::Hole {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  double radius = 0;
  // Of Holes::corners.
  size_t first = 0;
  size_t last = 0;
};

struct BorderStitcher::Holes {
  std::vector<Hole> holes = {};
  std::vector<Hole> islands = {};
  std::vector<std::pair<size_t, size_t>> island_of_hole = {};  // hole, island; ascending
  SpooledVector<int32_t> corners;

  absl::Span<const int32_t> CornersOf(const Hole& hole) const {
    return absl::MakeConstSpan(corners.data() + hole.first, hole.last - hole.first);
  }
};

BorderStitcher::Holes BorderStitcher::FindHoles(double max_width) const {
  Holes found = {.corners = SpooledVector<int32_t>(spool_beside_)};
  auto& [holes, islands, island_of_hole, corners] = found;
  SpooledVector<uint8_t> seen(spool_beside_);
  seen.assign(corners_.size(), 0);
  for (size_t i = 0; i < corners_.size(); ++i) {
    if (i % kCornersAtOnce == 0) {
      Release();
      seen.Release();
      corners.Release();
    }
    if (!corners_[i].open || seen[i] != 0) continue;
    Hole loop = {.first = corners.size()};
    Eigen::Vector3d center = Eigen::Vector3d::Zero();
    double spacing = 0;
    for (auto corner = static_cast<int32_t>(i); seen[static_cast<size_t>(corner)] == 0; corner = At(corner).next) {
      seen[static_cast<size_t>(corner)] = 1;
      corners.push_back(corner);
      center += Position(VertexOf(corner));
      spacing += Vertex(VertexOf(corner)).spacing;
    }
    loop.last = corners.size();
    const absl::Span<const int32_t> of_loop = found.CornersOf(loop);
    const auto count = static_cast<double>(of_loop.size());
    loop.center = center / count;
    spacing /= count;
    Eigen::Vector3d area = Eigen::Vector3d::Zero();
    Eigen::Vector3d normals = Eigen::Vector3d::Zero();
    for (const int32_t corner : of_loop) {
      const Eigen::Vector3d x = Position(VertexOf(corner)) - loop.center;
      area += x.cross(Position(VertexOf(At(corner).next)) - loop.center);
      normals += Normal(VertexOf(corner));
      loop.radius = std::max(loop.radius, x.norm());
    }
    const bool fits_width = 2 * loop.radius <= max_width * spacing && area.norm() > 0;
    if (fits_width && area.dot(normals) > 0) {  // the part lies inside
      loop.normal = area.normalized();
      islands.push_back(loop);
      continue;
    }
    loop.normal = -area.normalized();
    const bool is_slit =
        2 * loop.radius <= kSlitWidth * spacing && normals.normalized().dot(loop.normal) > kMinSlitCosine;
    const auto fits = [&](int32_t corner) {
      const int32_t v = VertexOf(corner);
      return Normal(v).dot(loop.normal) > kMinSheetCosine &&
             std::abs((Position(v) - loop.center).dot(loop.normal)) < 0.5 * loop.radius + 1.5 * spacing;
    };
    const auto is_flat = [&] {
      return static_cast<double>(std::ranges::count_if(of_loop, fits)) >= kMinFlatShare * count;
    };
    if (fits_width && (is_slit || is_flat())) {
      holes.push_back(loop);
    } else {
      corners.Shorten(loop.first);
    }
  }
  // The first hole around each island; only holes near it along x are looked at.
  std::vector<std::pair<double, size_t>> by_x;
  by_x.reserve(holes.size());
  double largest = 0;
  for (size_t h = 0; h < holes.size(); ++h) {
    by_x.emplace_back(holes[h].center.x(), h);
    largest = std::max(largest, holes[h].radius);
  }
  std::ranges::sort(by_x);
  for (size_t i = 0; i < islands.size(); ++i) {
    const Hole& island = islands[i];
    size_t around = holes.size();
    const double x = island.center.x();
    for (auto at = std::ranges::lower_bound(by_x, std::pair(x - largest, size_t{0}));
         at != by_x.end() && at->first <= x + largest; ++at) {
      const Hole& hole = holes[at->second];
      if ((island.center - hole.center).norm() + island.radius < 1.01 * hole.radius &&
          island.normal.dot(hole.normal) > kMinSheetCosine) {
        around = std::min(around, at->second);
      }
    }
    if (around != holes.size()) island_of_hole.emplace_back(around, i);
  }
  std::ranges::sort(island_of_hole);
  return found;
}

// The loop of gaps from one corner on, or nothing when it is longer than kMaxLoopCorners. A loop that comes to a vertex
// again is cut in two there, and the first part that does not is given.
std::vector<int32_t> BorderStitcher::CutSimpleLoop(int32_t first) {
  std::vector<int32_t> loop;
  absl::flat_hash_map<int32_t, size_t> place;  // of vertices in the loop
  int32_t corner = first;
  do {
    const auto [met, is_new] = place.try_emplace(VertexOf(corner), loop.size());
    if (!is_new) {
      loop.erase(loop.begin(), loop.begin() + static_cast<std::ptrdiff_t>(met->second));
      const int32_t before = At(loop.front()).previous;
      At(before).next = corner;
      At(corner).previous = before;
      At(loop.back()).next = loop.front();
      At(loop.front()).previous = loop.back();
      return loop;
    }
    if (loop.size() == kMaxLoopCorners) return {};
    loop.push_back(corner);
    corner = At(corner).next;
  } while (corner != first);
  return loop;
}

// Closes the loops that are left of a hole, each as a whole: rims that fold over in the hole's plane stop an advancing
// front.
void BorderStitcher::CloseLoops(absl::Span<const int32_t> corners, LoopFill fill) {
  std::vector<Eigen::Vector3d> positions;
  std::vector<Eigen::Vector3d> normals;
  absl::flat_hash_set<int32_t> given_up;
  for (const int32_t first : corners) {
    while (At(first).open && !given_up.contains(first)) {
      const std::vector<int32_t> loop = CutSimpleLoop(first);
      if (loop.size() < 3) break;
      positions.clear();
      normals.clear();
      for (const int32_t corner : loop) {
        positions.push_back(Position(VertexOf(corner)));
        if (fill == LoopFill::kByNormals) normals.push_back(Normal(VertexOf(corner)));
      }
      const auto vertex = [&](int32_t i) { return VertexOf(loop[static_cast<size_t>(i)]); };
      const std::vector<Face> triangles =
          TriangulateLoop(positions, normals, [&](int32_t i, int32_t j) { return !HasEdge(vertex(i), vertex(j)); });
      if (triangles.empty()) given_up.insert(loop.begin(), loop.end());
      for (const Face& triangle : triangles) {
        AddFace({vertex(triangle[0]), vertex(triangle[1]), vertex(triangle[2])});
      }
      if (!triangles.empty()) {
        for (const int32_t corner : loop) Close(At(corner));
      }
    }
  }
}

int64_t BorderStitcher::FillHoles(double max_width, const std::function<void()>& step) {
  const Holes found = FindHoles(max_width);
  auto island = found.island_of_hole.begin();
  std::vector<int32_t> corners;
  std::vector<int32_t> members;
  std::vector<Candidate> candidates;
  Steps filling(kSteps - kStepsOfStitching, step);
  for (size_t h = 0; h < found.holes.size(); ++h) {
    filling.Reach(static_cast<double>(h) / static_cast<double>(found.holes.size()));
    const Hole& hole = found.holes[h];
    const absl::Span<const int32_t> rim = found.CornersOf(hole);
    corners.assign(rim.begin(), rim.end());
    for (; island != found.island_of_hole.end() && island->first == h; ++island) {
      const absl::Span<const int32_t> around_it = found.CornersOf(found.islands[island->second]);
      corners.insert(corners.end(), around_it.begin(), around_it.end());
    }
    members.clear();
    for (const int32_t corner : corners) members.push_back(VertexOf(corner));
    std::ranges::sort(members);
    members.erase(std::unique(members.begin(), members.end()), members.end());
    const Scope scope = {.reach = std::numeric_limits<double>::infinity(),
                         .min_normal_cosine = kMinHoleNormalCosine,
                         .members = &members,
                         .normal = &hole.normal};
    candidates.clear();
    for (const int32_t edge : corners) {
      candidates.push_back(At(edge).open ? BestNow(edge, scope) : Candidate());
    }
    Advance(corners, scope, candidates, [](double) {});
    if (corners.size() == rim.size()) CloseLoops(corners, LoopFill::kByNormals);  // it has no islands
    if (h % kHolesAtOnce == 0) {
      Release();
      found.corners.Release();
    }
  }
  filling.Reach(1);
  std::vector<uint8_t> is_filled(found.holes.size(), 1);
  const auto is_closed = [&](const Hole& loop) {
    return std::ranges::none_of(found.CornersOf(loop), [&](int32_t corner) { return At(corner).open; });
  };
  for (size_t h = 0; h < is_filled.size(); ++h) is_filled[h] = is_closed(found.holes[h]) ? 1 : 0;
  for (const auto& [h, i] : found.island_of_hole) {
    if (!is_closed(found.islands[i])) is_filled[h] = 0;
  }
  return std::ranges::count(is_filled, 1);
}

}  // namespace meshwright
