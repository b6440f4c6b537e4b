// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <absl/container/flat_hash_map.h>
#include <absl/types/span.h>

#include "common/base/spooled_vector.h"
#include "common/base/thread_pool.h"
#include "common/mesh/point_blocks.h"

namespace meshwright {

// A vertex on the border of a part, with what is needed to sew it to others.
struct BorderVertex {
  Eigen::Vector3f position;  // scene units, world frame
  Eigen::Vector3f normal;    // unit
  float spacing = 0;         // scene units; distance to its neighbours in its lattice
  int32_t next = 0;          // border vertex where the border goes on, the part to its left
};

// Sews borders together with triangles between their vertices: an advancing front that gives each open edge the
// visible vertex that makes the largest angle over it, as a constrained Delaunay triangulation does, smallest
// circumcircles first (cf. Bernardini et al. 1999). Only open edges take a triangle and no edge is made twice, so that
// each edge has at most two triangles, and those run along it in opposite directions. The order, and so the result,
// depends on the border and the blocks alone.
//
// What grows with the border is spooled; memory holds a block of it at a time.
class BorderStitcher {
 public:
  using Face = std::array<int32_t, 3>;  // border vertices, counter-clockwise seen from outside

  // Number of a face that is none.
  static constexpr int32_t kNone = -1;

  // `inner_edges`: pairs (v, w) of border vertices, v < w, ascending by v, that an edge joins which has its two
  // triangles already. Vertices and edges must outlive the stitcher. What it needs is spooled beside `spool_beside`
  // (SpooledBytes).
  BorderStitcher(absl::Span<const BorderVertex> vertices, absl::Span<const std::pair<int32_t, int32_t>> inner_edges,
                 const std::string& spool_beside = {});

  // Both of what takes long call `step` now and then, together kSteps times.
  static constexpr int kSteps = 60;

  // Fills gaps wherever circumcircles have a radius of at most `reach` times the vertices' spacing, those at the
  // vertices of one block after those of the other.
  void StitchNearby(double reach, const PointBlocks& blocks, ThreadPool& pool, const std::function<void()>& step);

  // Takes the borders of all vertices that are to be dropped out of the game.
  void Drop(const std::function<bool(int32_t v)>& is_dropped);

  // Fills loops around holes of at most `max_width` times the vertices' spacing, together with the islands in them:
  // slits whatever their rims look like, wider holes where the rims are nearly flat. Returns how many.
  int64_t FillHoles(double max_width, const std::function<void()>& step);

  // Adds those of the triangles that can be sewn on one after the other, the smallest first. Returns how many.
  int64_t SewOn(absl::Span<const Face> triangles);

  // Adds those of the triangles whose corners lie in gaps and whose edges are all new, the smallest first, but for
  // slivers: they touch what is there in points, and leave slits around them. Returns how many.
  int64_t PutIn(absl::Span<const Face> triangles);

  // Closes loops of at most `max_width` times the vertices' spacing, however they are turned, by the least area: where
  // rims cross each other a loop is a gap in one place and surface that lies on surface in the next. The outside of
  // what is joined to nothing is no such loop. Where several gaps meet in a vertex they are told apart before by the
  // order in which surface lies around it. Takes faces that touch others in points alone out of the game (faces_alone).
  // Returns how many it has closed.
  int64_t CloseSlits(double max_width);

  // Whether a gap starts at the vertex.
  bool IsOpen(int32_t v) const { return open_at_vertex_[static_cast<size_t>(v)] > 0; }
  absl::Span<const BorderVertex> vertices() const { return vertices_; }
  // The edge from its first to its second vertex was open when a face was put over it.
  absl::Span<const Face> faces() const { return absl::MakeConstSpan(faces_.data(), faces_.size()); }
  // Of these, ascending, those that are to be left out.
  absl::Span<const int32_t> faces_alone() const { return faces_alone_; }
  // The face that has an edge from `from` to `to`, or kNone: a part may have it.
  int32_t FaceAlong(int32_t from, int32_t to) const;
  // Those that have the vertex, ascending.
  std::vector<int32_t> FacesAround(int32_t v) const;
  int64_t CountOpenEdges() const;
  // Where the part's border comes to the vertex from.
  int32_t PreviousInPart(int32_t v) const { return previous_in_part_[static_cast<size_t>(v)]; }
  // Gives memory back until it is asked for again.
  void Release() const;
  // Vertices that several gaps have met, ascending: closed or not, what lies between them may touch in the vertex
  // alone.
  std::vector<int32_t> VerticesThatHadSeveralGaps() const;

 private:
  // One gap at a vertex: the open edge that comes in and the one that goes out. A vertex may have several. The open
  // edge from a corner to the next one bears the corner's number.
  struct Corner {
    int32_t vertex = 0;
    int32_t previous = 0;
    int32_t next = 0;
    int32_t sibling = -1;  // another corner of the same vertex
    bool open = true;
  };
  struct Candidate {
    double cost = 0;      // radius of the circumcircle over the spacing
    int32_t corner = -1;  // to which the triangle goes; -1: none
    friend bool operator==(const Candidate&, const Candidate&) = default;
  };
  // What an edge may be joined to and within which limits.
  struct Scope {
    double reach = 0;
    double min_normal_cosine = 0;
    const std::vector<int32_t>* members = nullptr;  // vertices; null: all in the neighbourhood
    const Eigen::Vector3d* normal = nullptr;        // of the plane to work in; null: that of the vertices
  };
  // A vertex over an edge: the best one sees it under the widest angle.
  struct Apex {
    double cosine = 0;
    double cost = 0;
    int32_t corner = -1;
  };
  struct Segment {  // an open edge in the plane of an EdgeFrame
    Eigen::Vector2d from, to;
    int32_t from_vertex = 0;
    int32_t to_vertex = 0;
  };
  // Whether an open edge crosses the segment from one vertex to the other.
  static bool IsBlocked(absl::Span<const Segment> blockers, const Segment& segment);
  struct EdgeFrame;
  struct Hole;
  struct Holes;

  // Of the edge that is looked at; kept so that its memory is.
  struct Scratch {
    std::vector<int32_t> nearby;
    std::vector<Segment> blockers;
    std::vector<Apex> apexes;
  };

  using Progress = std::function<void(double share)>;

  // The triangle to put over an open edge; its grid is there (FindNearby).
  Candidate BestFor(int32_t edge, const Scope& scope, Scratch& scratch);
  Candidate BestNow(int32_t edge, const Scope& scope);
  // Of many edges while nothing changes, on all threads.
  std::vector<Candidate> BestForEach(absl::Span<const int32_t> edges, const Scope& scope, ThreadPool& pool,
                                     const Progress& progress);
  bool Fits(const EdgeFrame& frame, int32_t edge, int32_t corner, const Scope& scope, const Scratch& scratch) const;
  // Whether the triangle over `edge` to `corner` makes no edge that is there already.
  bool MakesNewEdges(int32_t edge, int32_t corner) const;
  // The same, and whether it keeps to the gaps of its corners.
  bool FitsGaps(int32_t edge, int32_t corner, const Scope& scope) const;
  // Where the triangle can be sewn on now: an open edge of it and the corner opposite; {-1, -1}: nowhere.
  std::pair<int32_t, int32_t> PlaceFor(const Face& triangle) const;
  // Of the longest edge.
  double SquaredLength(const Face& triangle) const;
  std::vector<Face> SmallestFirst(absl::Span<const Face> triangles) const;
  bool InGap(int32_t corner, int32_t vertex, const Scope& scope) const;
  // Outwards at a vertex.
  Eigen::Vector3d NormalFor(int32_t v, const Scope& scope) const { return scope.normal ? *scope.normal : Normal(v); }
  void Close(Corner& corner);
  bool HasEdge(int32_t v, int32_t w) const;
  void AddFace(const Face& face);
  void Apply(int32_t edge, int32_t corner, std::vector<int32_t>& changed);
  // `candidates`: what BestFor says of each edge now; none for those that are not open.
  void Advance(absl::Span<const int32_t> edges, const Scope& scope, absl::Span<const Candidate> candidates,
               const Progress& progress);
  double SearchRadius(int32_t edge, const Scope& scope) const;
  void MakeGrid(int level);
  void FindNearby(const Eigen::Vector3d& x, double radius, std::vector<int32_t>& found);
  void StitchBlock(const PointBlocks::Block& block, const Scope& scope, ThreadPool& pool, const Progress& looking,
                   const Progress& stitching);
  Holes FindHoles(double max_width) const;
  std::vector<int32_t> CutSimpleLoop(int32_t first);
  enum class LoopFill { kByNormals, kByArea };  // of TriangulateLoop
  void CloseLoops(absl::Span<const int32_t> corners, LoopFill fill);
  // Pairs the gaps' ends at a vertex anew, each with the next one around the vertex.
  void SortGapsAround(int32_t v);
  // So that no loop comes to a vertex twice.
  void CutLoops();
  // Whether nothing has been joined to the border that the loop runs along, and the part lies inside.
  bool IsIsland(absl::Span<const int32_t> loop) const;
  // The face that the loop runs around, if it is no more than that; else kNone.
  int32_t FaceWithin(absl::Span<const int32_t> loop) const;

  Corner& At(int32_t corner) { return corners_[static_cast<size_t>(corner)]; }
  const Corner& At(int32_t corner) const { return corners_[static_cast<size_t>(corner)]; }
  int32_t VertexOf(int32_t corner) const { return At(corner).vertex; }
  const BorderVertex& Vertex(int32_t v) const { return vertices_[static_cast<size_t>(v)]; }
  Eigen::Vector3d Position(int32_t v) const { return Vertex(v).position.cast<double>(); }
  Eigen::Vector3d Normal(int32_t v) const { return Vertex(v).normal.cast<double>(); }

  absl::Span<const BorderVertex> vertices_;
  absl::Span<const std::pair<int32_t, int32_t>> inner_edges_;
  std::string spool_beside_;
  SpooledVector<int32_t> previous_in_part_;
  SpooledVector<int32_t> first_inner_edge_;  // per vertex, and the end
  SpooledVector<Corner> corners_;            // corner v is the first one of vertex v
  SpooledVector<int32_t> open_at_vertex_;    // how many of its corners are open
  SpooledVector<Face> faces_;
  std::vector<int32_t> faces_alone_;
  // Corner k of face f is entry 3 f + k of a list of all that are at its vertex.
  static constexpr uint32_t kEnd = UINT32_MAX;
  SpooledVector<uint32_t> last_at_vertex_;
  SpooledVector<uint32_t> one_before_;
  // What is stitched now, the vertices around it, and where all of them are.
  const PointBlocks* blocks_ = nullptr;
  Eigen::AlignedBox3d near_block_;
  std::vector<int32_t> members_;
  // These in cubes of width 2^level; each grid is made when first asked for.
  absl::flat_hash_map<int, absl::flat_hash_map<std::array<int32_t, 3>, std::vector<int32_t>>> grids_;
  Scratch scratch_;
};

}  // namespace meshwright
