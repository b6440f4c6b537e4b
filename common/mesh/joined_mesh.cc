// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/joined_mesh.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include <absl/types/span.h>

#include "common/base/check.h"
#include "common/base/out_of_range.h"
#include "common/base/spooled_vector.h"
#include "common/base/status_macros.h"
#include "common/mesh/border_stitching.h"
#include "common/mesh/disjoint_sets.h"
#include "common/mesh/finished_part.h"
#include "common/mesh/gap_closing.h"
#include "common/mesh/part_borders.h"
#include "common/mesh/ply.h"
#include "common/mesh/point_blocks.h"
#include "common/mesh/seam_blending.h"

namespace meshwright {
namespace {

PlyAttributes AttributesWith(const Eigen::Vector3d& offset) {
  return {.normals = true, .colors = true, .quality = true, .cameras = true, .offset = offset};
}
// Seams are one or two steps wide; the circle through their corners is a little larger.
constexpr double kStitchReach = 2;
// Loops this wide are closed however they are turned, in the vertices' spacing.
constexpr double kMaxSlitWidth = 20;
// Offsets at a seam are averaged over this many vertices to either side, so that texture does not smear.
constexpr int kSeamSmoothing = 8;
// What is done before memory is given back.
constexpr size_t kFacesAtOnce = 65536;

// Per component of a part: whether what it is joined to edge by edge has too few faces. A lone triangle always has.
std::vector<uint8_t> SmallComponents(const PartBorders& borders, const BorderStitcher& stitcher, int64_t min_faces,
                                     int64_t& removed) {
  const size_t components = borders.faces_of_component.size();
  DisjointSets sets(components);
  std::vector<int64_t> total = borders.faces_of_component;
  SpooledVector<int32_t> component_of_face(borders.spool_beside);
  const absl::Span<const BorderStitcher::Face> faces = stitcher.faces();
  for (size_t f = 0; f < faces.size(); ++f) {
    if (f % kFacesAtOnce == 0) {
      borders.Release();
      stitcher.Release();
      component_of_face.Release();
    }
    int32_t component = -1;
    for (size_t k = 0; k < 3; ++k) {
      const int32_t from = faces[f][k];
      const int32_t to = faces[f][(k + 1) % 3];
      // A part's border runs the other way.
      int32_t other = -1;
      if (borders.vertices[static_cast<size_t>(to)].next == from) {
        other = borders.origins[static_cast<size_t>(to)].component;
      } else {
        const int32_t face = stitcher.FaceAlong(to, from);
        // Later ones will come to this one.
        if (face != BorderStitcher::kNone && face < static_cast<int32_t>(f)) {
          other = component_of_face[static_cast<size_t>(face)];
        }
      }
      if (other < 0) continue;
      if (component >= 0) sets.Join(component, other);
      component = other;
    }
    MW_CHECK(component >= 0);  // each was put over an edge of what was there
    component_of_face.push_back(component);
    ++total[static_cast<size_t>(component)];
  }
  for (size_t c = 0; c < components; ++c) {
    const auto root = static_cast<size_t>(sets.Root(static_cast<int32_t>(c)));
    if (root != c) total[root] += std::exchange(total[c], 0);
  }
  std::vector<uint8_t> small(components, 0);
  for (size_t c = 0; c < components; ++c) {
    const auto root = static_cast<size_t>(sets.Root(static_cast<int32_t>(c)));
    small[c] = total[root] < std::max<int64_t>(min_faces, 2) ? 1 : 0;
    if (small[c] != 0 && root == c) ++removed;
  }
  return small;
}

// How a border vertex differs from those of other parts that it is stitched to, in grey levels.
struct SeamDifference {
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  float weight = 0;
};

SpooledVector<SeamDifference> SeamDifferences(const PartBorders& borders,
                                              absl::Span<const BorderStitcher::Face> stitches) {
  SpooledVector<SeamDifference> differences(borders.spool_beside);
  differences.assign(borders.origins.size(), {});
  for (size_t f = 0; f < stitches.size(); ++f) {
    if (f % kFacesAtOnce == 0) {
      borders.Release();
      differences.Release();
    }
    const BorderStitcher::Face& face = stitches[f];
    std::array<size_t, 3> parts = {};
    std::ranges::transform(face, parts.begin(), [&](int32_t v) { return borders.PartOf(v); });
    for (size_t i = 0; i < 3; ++i) {
      for (size_t j = 0; j < 3; ++j) {
        if (parts[i] == parts[j]) continue;
        const auto v = static_cast<size_t>(face[i]);
        const auto w = static_cast<size_t>(face[j]);
        Eigen::Vector3f offset;
        for (int k = 0; k < 3; ++k) {
          offset[k] = static_cast<float>(borders.origins[w].color[static_cast<size_t>(k)]) -
                      static_cast<float>(borders.origins[v].color[static_cast<size_t>(k)]);
        }
        differences[v].sum += offset;
        differences[v].weight += 1;
      }
    }
  }
  return differences;
}

// Half of what separates each border vertex of the part from other parts.
std::vector<SeamOffset> SeamOffsets(const PartBorders& borders, const SpooledVector<SeamDifference>& differences,
                                    size_t part) {
  const auto first = static_cast<size_t>(borders.parts[part].first_border);
  const auto last = static_cast<size_t>(borders.parts[part + 1].first_border);
  const auto next = [&](size_t v) { return static_cast<size_t>(borders.vertices[v].next); };
  std::vector<size_t> previous(last - first);
  for (size_t v = first; v < last; ++v) previous[next(v) - first] = v;
  std::vector<SeamOffset> offsets;
  for (size_t v = first; v < last; ++v) {
    if (differences[v].weight == 0) continue;
    Eigen::Vector3f total = differences[v].sum;
    float total_weight = differences[v].weight;
    size_t before = v;
    size_t after = v;
    for (int k = 0; k < kSeamSmoothing; ++k) {
      before = previous[before - first];
      after = next(after);
      total += differences[before].sum + differences[after].sum;
      total_weight += differences[before].weight + differences[after].weight;
    }
    total *= 0.5F / total_weight;
    offsets.push_back({borders.origins[v].patch, total});
  }
  return offsets;
}

// A vertex at which several gaps met may join fans of triangles in a point only. Each fan but the one that lies in
// its part gets a copy of the vertex in `faces`, which are the stitcher's, numbered behind its vertices. Returns what
// is copied.
std::vector<int32_t> SplitPoints(const BorderStitcher& stitcher, SpooledVector<BorderStitcher::Face>& faces) {
  std::vector<int32_t> copies;
  for (const int32_t point : stitcher.VerticesThatHadSeveralGaps()) {
    std::vector<int32_t> around = stitcher.FacesAround(point);
    std::erase_if(around, [&](int32_t f) { return std::ranges::binary_search(stitcher.faces_alone(), f); });
    // The last one stands for the fan in the part.
    std::vector<std::pair<int32_t, int32_t>> ends;  // the face's next corner and the one after that
    for (const int32_t f : around) {
      const BorderStitcher::Face& face = stitcher.faces()[static_cast<size_t>(f)];
      const auto k = static_cast<size_t>(std::ranges::find(face, point) - face.begin());
      ends.emplace_back(face[(k + 1) % 3], face[(k + 2) % 3]);
    }
    ends.emplace_back(stitcher.vertices()[static_cast<size_t>(point)].next, stitcher.PreviousInPart(point));
    DisjointSets fans(ends.size());
    for (size_t x = 0; x < ends.size(); ++x) {
      for (size_t y = 0; y < ends.size(); ++y) {
        if (ends[x].first == ends[y].second) fans.Join(static_cast<int32_t>(x), static_cast<int32_t>(y));
      }
    }
    const int32_t in_part = fans.Root(static_cast<int32_t>(around.size()));
    std::vector<int32_t> copy_of_fan(ends.size(), -1);
    for (size_t x = 0; x < around.size(); ++x) {
      const int32_t fan = fans.Root(static_cast<int32_t>(x));
      if (fan == in_part) continue;
      int32_t& copy = copy_of_fan[static_cast<size_t>(fan)];
      if (copy < 0) {
        copy = static_cast<int32_t>(stitcher.vertices().size() + copies.size());
        copies.push_back(point);
      }
      const auto f = static_cast<size_t>(around[x]);
      const BorderStitcher::Face& face = stitcher.faces()[f];
      faces[f][static_cast<size_t>(std::ranges::find(face, point) - face.begin())] = copy;
    }
  }
  return copies;
}

// The rest moves up. `which` ascends.
void LeaveOut(absl::Span<const int32_t> which, SpooledVector<BorderStitcher::Face>& faces) {
  size_t end = 0;
  for (size_t f = 0; f < faces.size(); ++f) {
    if (!which.empty() && which.front() == static_cast<int32_t>(f)) {
      which.remove_prefix(1);
    } else {
      faces[end++] = faces[f];
    }
  }
  faces.Shorten(end);
}

void AppendVertex(const TriangleMesh& from, size_t vertex, TriangleMesh& to) {
  to.positions.push_back(from.positions[vertex]);
  to.normals.push_back(from.normals[vertex]);
  to.colors.push_back(from.colors[vertex]);
  to.quality.push_back(from.quality[vertex]);
  to.cameras.push_back(from.cameras[vertex]);
}

// Everything about the joins that the writing of parts needs.
struct Joins {
  explicit Joins(const std::string& spool_beside)
      : faces(spool_beside), differences(spool_beside), edges(spool_beside) {}

  void Release() const {
    faces.Release();
    differences.Release();
    edges.Release();
  }

  SpooledVector<BorderStitcher::Face> faces;  // border vertices, and copies of them numbered behind
  std::vector<int32_t> copies;                // the border vertex that each is a copy of, ascending
  SpooledVector<SeamDifference> differences;
  std::vector<uint8_t> small;  // per component: to be left out
  // (from, to) of the faces between vertices of one part that are no copies, ascending.
  SpooledVector<std::pair<int32_t, int32_t>> edges;
};

void CollectEdges(const PartBorders& borders, Joins& joins) {
  const auto vertices = static_cast<int32_t>(borders.vertices.size());
  for (const BorderStitcher::Face& face : joins.faces) {
    for (size_t k = 0; k < 3; ++k) {
      const int32_t from = face[k];
      const int32_t to = face[(k + 1) % 3];
      if (from < vertices && to < vertices && borders.PartOf(from) == borders.PartOf(to)) {
        joins.edges.push_back({from, to});
      }
    }
  }
  std::sort(joins.edges.begin(), joins.edges.end());
}

// Adds them one way or the other, a block's worth after the other.
int64_t Add(absl::Span<const BorderStitcher::Face> triangles,
            int64_t (BorderStitcher::*add)(absl::Span<const BorderStitcher::Face>), const JoinOptions& options,
            BorderStitcher& stitcher) {
  const auto at_once = static_cast<size_t>(options.vertices_of_block);
  int64_t added = 0;
  for (; !triangles.empty(); triangles.remove_prefix(std::min(at_once, triangles.size()))) {
    added += (stitcher.*add)(triangles.subspan(0, at_once));
    stitcher.Release();
  }
  return added;
}

// Stitches all but the components that are small, and finds which are. Triangles to crumbs keep others from meeting:
// these are taken away with them, and what they leave open is stitched again, until all that is left is large.
// Tells `first_step` how far the first round is.
BorderStitcher Stitched(const PartBorders& borders, const JoinOptions& options, ThreadPool& pool,
                        const std::function<void()>& first_step, std::vector<uint8_t>& small,
                        JoinedMeshCounts& counts) {
  small.assign(borders.faces_of_component.size(), 0);
  const PointBlocks blocks(
      static_cast<int32_t>(borders.vertices.size()),
      [&](int32_t v) { return borders.vertices[static_cast<size_t>(v)].position.cast<double>(); },
      static_cast<size_t>(options.vertices_of_block), borders.spool_beside);
  std::function<void()> step = first_step;
  SpooledVector<BorderStitcher::Face> stays(borders.spool_beside);
  while (true) {
    BorderStitcher stitcher(absl::MakeConstSpan(borders.vertices.data(), borders.vertices.size()),
                            absl::MakeConstSpan(borders.inner_edges.data(), borders.inner_edges.size()),
                            borders.spool_beside);
    // Lone triangles are noise, and to a stitcher their outside looks like a hole.
    stitcher.Drop([&](int32_t v) {
      const auto component = static_cast<size_t>(borders.origins[static_cast<size_t>(v)].component);
      return small[component] != 0 || borders.faces_of_component[component] == 1;
    });
    Add(absl::MakeConstSpan(stays.data(), stays.size()), &BorderStitcher::SewOn, options, stitcher);
    stitcher.StitchNearby(kStitchReach, blocks, pool, step);
    step = [&] { borders.Release(); };
    int64_t removed = 0;
    std::vector<uint8_t> now_small = SmallComponents(borders, stitcher, options.min_component_faces, removed);
    if (now_small == small) {
      counts.components_removed = removed;
      return stitcher;
    }
    small = std::move(now_small);
    const auto is_small = [&](int32_t v) {
      return small[static_cast<size_t>(borders.origins[static_cast<size_t>(v)].component)] != 0;
    };
    stays.Shorten(0);
    for (const BorderStitcher::Face& face : stitcher.faces()) {
      if (std::ranges::none_of(face, is_small)) stays.push_back(face);
    }
    borders.Release();
    stays.Release();
  }
}

absl::StatusOr<Joins> JoinBorders(const PartBorders& borders, const JoinOptions& options, const LoadSurface& load,
                                  ThreadPool& pool, JoinProgress& progress, JoinedMeshCounts& counts) {
  Joins joins(borders.spool_beside);
  const auto step = [&] {
    progress.Step(JoinStage::kStitching, BorderStitcher::kSteps);
    borders.Release();
  };
  BorderStitcher stitcher = Stitched(borders, options, pool, step, joins.small, counts);
  const size_t stitch_faces = stitcher.faces().size();
  counts.holes_filled = stitcher.FillHoles(options.max_hole_steps, step);
  if (options.close_reach > 0) {
    MW_ASSIGN_OR_RETURN(const std::vector<BorderStitcher::Face> triangles,
                        FindGapTriangles(borders, stitcher, joins.small, options.close_reach, load, pool, progress));
    counts.closing_faces = Add(triangles, &BorderStitcher::SewOn, options, stitcher) +
                           Add(triangles, &BorderStitcher::PutIn, options, stitcher);
    // What it has left open is small now.
    counts.holes_filled += stitcher.FillHoles(options.max_hole_steps, [] {});
  }
  counts.holes_filled += stitcher.CloseSlits(std::min(options.max_hole_steps, kMaxSlitWidth));
  counts.border_edges_after = stitcher.CountOpenEdges();
  counts.stitch_faces = static_cast<int64_t>(stitch_faces);
  const auto alone = static_cast<int64_t>(stitcher.faces_alone().size());
  counts.closing_faces -= alone;
  counts.hole_faces = static_cast<int64_t>(stitcher.faces().size() - stitch_faces) - alone - counts.closing_faces;
  joins.differences = SeamDifferences(borders, stitcher.faces().subspan(0, stitch_faces));
  const auto position = [&](int32_t v) { return stitcher.vertices()[static_cast<size_t>(v)].position; };
  const auto area = [&](const BorderStitcher::Face& face) {
    return TriangleArea(position(face[0]), position(face[1]), position(face[2]));
  };
  for (size_t f = 0; f < stitcher.faces().size(); ++f) {
    counts.area += area(stitcher.faces()[f]);
    joins.faces.push_back(stitcher.faces()[f]);
    if (f % kFacesAtOnce == 0) {
      borders.Release();
      stitcher.Release();
      joins.Release();
    }
  }
  joins.copies = SplitPoints(stitcher, joins.faces);
  for (const int32_t f : stitcher.faces_alone()) counts.area -= area(stitcher.faces()[static_cast<size_t>(f)]);
  LeaveOut(stitcher.faces_alone(), joins.faces);
  if (options.simplify_footprints > 0) CollectEdges(borders, joins);
  return joins;
}

// What of the joins concerns one part.
PartJoins JoinsOfPart(const PartBorders& borders, const Joins& joins, size_t index) {
  const PartBorders::Part& part = borders.parts[index];
  const int32_t end = borders.parts[index + 1].first_border;
  PartJoins of_part = {.small = joins.small.data() + part.first_component,
                       .offsets = SeamOffsets(borders, joins.differences, index)};
  const auto vertex = [&](int32_t v) { return static_cast<uint32_t>(borders.origins[static_cast<size_t>(v)].vertex); };
  const auto* edge = std::lower_bound(joins.edges.begin(), joins.edges.end(), std::pair(part.first_border, int32_t{0}));
  for (; edge != joins.edges.end() && edge->first < end; ++edge) {
    of_part.edges.emplace_back(vertex(edge->first), vertex(edge->second));
  }
  return of_part;
}

// Writes parts one behind the other and remembers where their borders' vertices are.
class PartWriter {
 public:
  PartWriter(const PartBorders& borders, const Joins& joins, PlyStreamWriter& writer)
      : borders_(borders), joins_(joins), writer_(writer), index_of_border_(borders.spool_beside) {
    index_of_border_.assign(borders.origins.size() + joins.copies.size(), 0);
  }

  absl::Status Append(int64_t part, const FinishedPart& finished) {
    const auto end = borders_.parts[static_cast<size_t>(part) + 1].first_border;
    for (int32_t border = borders_.parts[static_cast<size_t>(part)].first_border; border < end; ++border) {
      const auto v = static_cast<size_t>(border);
      const int32_t at = finished.index[static_cast<size_t>(borders_.origins[v].vertex)];
      if (at < 0) continue;
      index_of_border_[v] = static_cast<uint32_t>(writer_.vertices() + at);
      if (!std::ranges::binary_search(joins_.copies, border)) continue;
      AppendVertex(finished.mesh, static_cast<size_t>(at), copied_vertices_);
      copied_borders_.push_back(border);
    }
    return writer_.Append(finished.mesh);
  }

  // Once all parts are there.
  absl::Status AppendJoins() {
    TriangleMesh copies;
    for (size_t c = 0; c < joins_.copies.size(); ++c) {
      const auto at = std::ranges::lower_bound(copied_borders_, joins_.copies[c]) - copied_borders_.begin();
      index_of_border_[borders_.origins.size() + c] = static_cast<uint32_t>(writer_.vertices() + c);
      AppendVertex(copied_vertices_, static_cast<size_t>(at), copies);
    }
    MW_RETURN_IF_ERROR(writer_.Append(copies));
    std::vector<std::array<uint32_t, 3>> faces;
    for (size_t f = 0; f < joins_.faces.size(); ++f) {
      std::array<uint32_t, 3>& corners = faces.emplace_back();
      for (size_t k = 0; k < 3; ++k) corners[k] = index_of_border_[static_cast<size_t>(joins_.faces[f][k])];
      if (faces.size() < kFacesAtOnce && f + 1 < joins_.faces.size()) continue;
      MW_RETURN_IF_ERROR(writer_.AppendFaces(faces));
      faces.clear();
      Release();
      joins_.Release();
    }
    return absl::OkStatus();
  }

  void Release() const { index_of_border_.Release(); }

 private:
  const PartBorders& borders_;
  const Joins& joins_;
  PlyStreamWriter& writer_;
  SpooledVector<uint32_t> index_of_border_;  // and of the copies, in the file
  TriangleMesh copied_vertices_;
  std::vector<int32_t> copied_borders_;  // ascending
};

}  // namespace

absl::Status JoinOptions::Validate() const {
  if (min_component_faces < 0) return OutOfRange("min_component_faces", min_component_faces, "at least 0");
  if (!(max_hole_steps >= 0 && max_hole_steps <= 1000)) {
    return OutOfRange("max_hole_steps", max_hole_steps, "0 to 1000");
  }
  if (!(close_reach >= 0 && close_reach <= 1)) return OutOfRange("close_reach", close_reach, "0 to 1");
  if (blend_steps < 0 || blend_steps > 1000) return OutOfRange("blend_steps", blend_steps, "0 to 1000");
  if (!(simplify_footprints >= 0 && simplify_footprints <= 100)) {
    return OutOfRange("simplify_footprints", simplify_footprints, "0 to 100 pixel footprints");
  }
  if (vertices_of_block <= 0) return OutOfRange("vertices_of_block", vertices_of_block, "more than 0");
  return absl::OkStatus();
}

absl::StatusOr<JoinedMeshCounts> WriteJoinedMesh(int64_t count, const LoadSurface& load, const JoinOptions& options,
                                                 const Eigen::Vector3d& offset, const std::string& path,
                                                 ThreadPool& pool, const JoinListener& listener) {
  MW_RETURN_IF_ERROR(options.Validate());
  JoinedMeshCounts counts;
  JoinProgress progress(listener);
  MW_ASSIGN_OR_RETURN(PartBorders borders, FindPartBorders(count, load, path, pool, progress));
  counts.border_edges_before = static_cast<int64_t>(borders.vertices.size());
  counts.patches_trimmed = std::count(borders.trimmed.begin(), borders.trimmed.end(), 1);
  std::vector<int64_t> patches;
  for (size_t i = 0; i < static_cast<size_t>(count); ++i) {
    patches.push_back(static_cast<int64_t>(borders.Trimmed(i).size()));
  }
  MW_ASSIGN_OR_RETURN(const Joins joins, JoinBorders(borders, options, load, pool, progress, counts));
  borders.inner = SpooledVector<InnerSample>();
  borders.inner_edges = SpooledVector<std::pair<int32_t, int32_t>>();

  MW_ASSIGN_OR_RETURN(PlyStreamWriter writer, PlyStreamWriter::Create(path, AttributesWith(offset)));
  PartWriter part_writer(borders, joins, writer);
  for (const auto& [first, last] : BatchesOfParts(patches)) {
    std::vector<FinishedPart> parts(static_cast<size_t>(last - first));
    MW_RETURN_IF_ERROR(ForEachPart(first, last, pool, [&, first = first](int64_t i) -> absl::Status {
      const auto index = static_cast<size_t>(i);
      MW_ASSIGN_OR_RETURN(const std::shared_ptr<const SparseSurface> surface, load(i));
      parts[static_cast<size_t>(i - first)] =
          FinishPart(*surface, borders.Trimmed(index), JoinsOfPart(borders, joins, index), options.blend_steps,
                     options.simplify_footprints);
      return absl::OkStatus();
    }));
    for (int64_t i = first; i < last; ++i) {
      const FinishedPart part = std::exchange(parts[static_cast<size_t>(i - first)], {});
      counts.faces_simplified += part.faces_simplified;
      counts.area += part.area;
      MW_RETURN_IF_ERROR(part_writer.Append(i, part));
      progress.Step(JoinStage::kWriting, count);
    }
    borders.Release();
    joins.Release();
    part_writer.Release();
  }
  MW_RETURN_IF_ERROR(part_writer.AppendJoins());
  MW_RETURN_IF_ERROR(writer.Commit());
  counts.vertices = writer.vertices();
  counts.faces = writer.faces();
  return counts;
}

}  // namespace meshwright
