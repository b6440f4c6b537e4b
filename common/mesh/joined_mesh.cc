// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/joined_mesh.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <absl/container/flat_hash_map.h>

#include "common/base/check.h"
#include "common/base/out_of_range.h"
#include "common/base/status_macros.h"
#include "common/mesh/border_stitching.h"
#include "common/mesh/disjoint_sets.h"
#include "common/mesh/finished_part.h"
#include "common/mesh/gap_closing.h"
#include "common/mesh/ply.h"
#include "common/mesh/seam_blending.h"

namespace meshwright {
namespace {

PlyAttributes AttributesWith(const Eigen::Vector3d& offset) {
  return {.normals = true, .colors = true, .quality = true, .cameras = true, .offset = offset};
}
// Seams are one or two steps wide; the circle through their corners is a little larger.
constexpr double kStitchReach = 2;
// Offsets at a seam are averaged over this many vertices to either side, so that texture does not smear.
constexpr int kSeamSmoothing = 8;

// Border vertices of triangles without neighbours. They are noise, and to a stitcher their outside looks like a hole.
std::vector<uint8_t> LoneTriangles(const PartBorders& borders) {
  std::vector<uint8_t> lone(borders.origins.size());
  for (size_t v = 0; v < lone.size(); ++v) {
    lone[v] = borders.faces_of_component[static_cast<size_t>(borders.origins[v].component)] == 1 ? 1 : 0;
  }
  return lone;
}

// Per component of a part: whether what it is joined to edge by edge has too few faces. A lone triangle always has.
std::vector<uint8_t> SmallComponents(const PartBorders& borders, const std::vector<BorderStitcher::Face>& faces,
                                     int64_t min_faces, int64_t& removed) {
  const size_t components = borders.faces_of_component.size();
  DisjointSets sets(components + faces.size());  // components, then faces
  absl::flat_hash_map<std::pair<int32_t, int32_t>, int32_t> face_at_edge;
  for (size_t f = 0; f < faces.size(); ++f) {
    const auto face = static_cast<int32_t>(components + f);
    for (size_t k = 0; k < 3; ++k) {
      const int32_t from = faces[f][k];
      const int32_t to = faces[f][(k + 1) % 3];
      // A part's border runs the other way.
      if (borders.vertices[static_cast<size_t>(to)].next == from) {
        sets.Join(borders.origins[static_cast<size_t>(to)].component, face);
      } else {
        const auto [other, is_new] = face_at_edge.try_emplace(std::minmax(from, to), face);
        if (!is_new) sets.Join(other->second, face);
      }
    }
  }
  std::vector<int64_t> total(components + faces.size(), 0);
  for (size_t i = 0; i < total.size(); ++i) {
    const auto root = static_cast<size_t>(sets.Root(static_cast<int32_t>(i)));
    total[root] += i < components ? borders.faces_of_component[i] : 1;
  }
  std::vector<uint8_t> small(components, 0);
  for (size_t c = 0; c < components; ++c) {
    const auto root = static_cast<size_t>(sets.Root(static_cast<int32_t>(c)));
    small[c] = total[root] < std::max<int64_t>(min_faces, 2) ? 1 : 0;
    if (small[c] != 0 && root == c) ++removed;
  }
  return small;
}

// Half of what separates each vertex from those of other parts that it is stitched to.
std::vector<std::optional<SeamOffset>> SeamOffsets(const PartBorders& borders,
                                                   const std::vector<BorderVertex>& vertices,
                                                   const std::vector<BorderStitcher::Face>& faces,
                                                   const std::vector<uint8_t>& is_stitch) {
  const size_t count = vertices.size();
  std::vector<int32_t> part_of(count, 0);
  for (size_t part = 0; part + 1 < borders.parts.size(); ++part) {
    std::fill(part_of.begin() + borders.parts[part].first_border,
              part_of.begin() + borders.parts[part + 1].first_border, static_cast<int32_t>(part));
  }
  std::vector<Eigen::Vector3f> sum(count, Eigen::Vector3f::Zero());
  std::vector<float> weight(count, 0);
  for (size_t f = 0; f < faces.size(); ++f) {
    if (is_stitch[f] == 0) continue;
    for (const int32_t i : faces[f]) {
      for (const int32_t j : faces[f]) {
        const auto v = static_cast<size_t>(i);
        const auto w = static_cast<size_t>(j);
        if (part_of[v] == part_of[w]) continue;
        Eigen::Vector3f offset;
        for (int k = 0; k < 3; ++k) {
          offset[k] = static_cast<float>(borders.origins[w].color[static_cast<size_t>(k)]) -
                      static_cast<float>(borders.origins[v].color[static_cast<size_t>(k)]);
        }
        sum[v] += offset;
        weight[v] += 1;
      }
    }
  }
  std::vector<std::optional<SeamOffset>> offsets(count);
  std::vector<int32_t> previous(count, 0);
  for (size_t v = 0; v < count; ++v) previous[static_cast<size_t>(vertices[v].next)] = static_cast<int32_t>(v);
  for (size_t v = 0; v < count; ++v) {
    if (weight[v] == 0) continue;
    Eigen::Vector3f total = sum[v];
    float total_weight = weight[v];
    size_t before = v;
    size_t after = v;
    for (int k = 0; k < kSeamSmoothing; ++k) {
      before = static_cast<size_t>(previous[before]);
      after = static_cast<size_t>(vertices[after].next);
      total += sum[before] + sum[after];
      total_weight += weight[before] + weight[after];
    }
    total *= 0.5F / total_weight;
    offsets[v] = SeamOffset{borders.origins[v].patch, total};
  }
  return offsets;
}

// A vertex at which several gaps meet would join fans of triangles in a point only. Each fan but the one that lies in
// its part gets a copy of the vertex, numbered from `vertices` on. Returns what is copied.
std::vector<int32_t> SplitPoints(const BorderStitcher& stitcher, std::vector<BorderStitcher::Face>& faces) {
  const std::vector<int32_t> points = stitcher.VerticesWithSeveralGaps();
  std::vector<int32_t> slot_of_vertex(stitcher.vertices().size(), -1);
  for (size_t i = 0; i < points.size(); ++i) slot_of_vertex[static_cast<size_t>(points[i])] = static_cast<int32_t>(i);
  std::vector<std::vector<std::pair<size_t, size_t>>> corners(points.size());  // face, corner
  for (size_t f = 0; f < faces.size(); ++f) {
    for (size_t k = 0; k < 3; ++k) {
      const int32_t slot = slot_of_vertex[static_cast<size_t>(faces[f][k])];
      if (slot >= 0) corners[static_cast<size_t>(slot)].emplace_back(f, k);
    }
  }
  std::vector<int32_t> previous(stitcher.vertices().size(), 0);
  for (size_t v = 0; v < previous.size(); ++v) {
    previous[static_cast<size_t>(stitcher.vertices()[v].next)] = static_cast<int32_t>(v);
  }
  const std::vector<BorderStitcher::Face> original = faces;
  std::vector<int32_t> copies;
  for (size_t i = 0; i < points.size(); ++i) {
    const auto& around = corners[i];
    // The last one stands for the fan in the part.
    std::vector<std::pair<int32_t, int32_t>> ends;  // the face's next corner and the one after that
    for (const auto& [f, k] : around) ends.emplace_back(original[f][(k + 1) % 3], original[f][(k + 2) % 3]);
    ends.emplace_back(stitcher.vertices()[static_cast<size_t>(points[i])].next,
                      previous[static_cast<size_t>(points[i])]);
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
        copies.push_back(points[i]);
      }
      faces[around[x].first][around[x].second] = copy;
    }
  }
  return copies;
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
  std::vector<BorderStitcher::Face> faces;  // border vertices, and copies of them numbered behind
  std::vector<int32_t> copies;              // the border vertex that each is a copy of
  std::vector<std::optional<SeamOffset>> offsets;
  std::vector<uint8_t> small;  // per component: to be left out
  // (from, to) of the faces between vertices that are no copies, ascending.
  std::vector<std::pair<int32_t, int32_t>> edges;
};

std::vector<std::pair<int32_t, int32_t>> SortedEdges(const std::vector<BorderStitcher::Face>& faces, int32_t vertices) {
  std::vector<std::pair<int32_t, int32_t>> edges;
  for (const auto& face : faces) {
    for (size_t k = 0; k < 3; ++k) {
      const int32_t from = face[k];
      const int32_t to = face[(k + 1) % 3];
      if (from < vertices && to < vertices) edges.emplace_back(from, to);
    }
  }
  std::ranges::sort(edges);
  return edges;
}

// Stitches all but the components that are small, and finds which are. Triangles to crumbs keep others from meeting:
// these are taken away with them, and what they leave open is stitched again, until all that is left is large.
BorderStitcher Stitched(const PartBorders& borders, const JoinOptions& options, ThreadPool& pool,
                        JoinProgress& progress, std::vector<uint8_t>& small, JoinedMeshCounts& counts) {
  small.assign(borders.faces_of_component.size(), 0);
  const std::vector<uint8_t> lone = LoneTriangles(borders);
  std::function<void()> step = [&] { progress.Step(JoinStage::kStitching, BorderStitcher::kSteps); };
  std::vector<BorderStitcher::Face> stays;
  while (true) {
    BorderStitcher stitcher(borders.vertices, borders.inner_edges);
    std::vector<uint8_t> drop = lone;
    for (size_t v = 0; v < drop.size(); ++v) {
      if (small[static_cast<size_t>(borders.origins[v].component)] != 0) drop[v] = 1;
    }
    stitcher.Drop(drop);
    stitcher.SewOn(stays);
    stitcher.StitchNearby(kStitchReach, pool, step);
    step = [] {};
    int64_t removed = 0;
    std::vector<uint8_t> now_small = SmallComponents(borders, stitcher.faces(), options.min_component_faces, removed);
    if (now_small == small) {
      counts.components_removed = removed;
      return stitcher;
    }
    small = std::move(now_small);
    const auto is_small = [&](int32_t v) {
      return small[static_cast<size_t>(borders.origins[static_cast<size_t>(v)].component)] != 0;
    };
    stays = stitcher.faces();
    std::erase_if(stays, [&](const BorderStitcher::Face& face) { return std::ranges::any_of(face, is_small); });
  }
}

absl::StatusOr<Joins> JoinBorders(const PartBorders& borders, const JoinOptions& options, const LoadSurface& load,
                                  ThreadPool& pool, JoinProgress& progress, JoinedMeshCounts& counts) {
  Joins joins;
  BorderStitcher stitcher = Stitched(borders, options, pool, progress, joins.small, counts);
  const size_t stitch_faces = stitcher.faces().size();
  const auto step = [&] { progress.Step(JoinStage::kStitching, BorderStitcher::kSteps); };
  counts.holes_filled = stitcher.FillHoles(options.max_hole_steps, step);
  if (options.close_reach > 0) {
    MW_ASSIGN_OR_RETURN(const std::vector<BorderStitcher::Face> triangles,
                        FindGapTriangles(
                            borders, [&](int32_t v) { return stitcher.IsOpen(v); }, joins.small, options.close_reach,
                            load, pool, progress));
    counts.closing_faces = stitcher.SewOn(triangles);
    // What it has left open is small now.
    counts.holes_filled += stitcher.FillHoles(options.max_hole_steps, [] {});
  }
  counts.border_edges_after = stitcher.CountOpenEdges();

  joins.faces = stitcher.faces();
  std::vector<uint8_t> is_stitch(joins.faces.size(), 0);
  std::fill(is_stitch.begin(), is_stitch.begin() + static_cast<int64_t>(stitch_faces), 1);
  joins.offsets = SeamOffsets(borders, stitcher.vertices(), joins.faces, is_stitch);
  counts.stitch_faces = static_cast<int64_t>(stitch_faces);
  counts.hole_faces = static_cast<int64_t>(joins.faces.size() - stitch_faces) - counts.closing_faces;
  const auto position = [&](int32_t v) { return stitcher.vertices()[static_cast<size_t>(v)].position; };
  for (const auto& face : joins.faces) {
    counts.area += TriangleArea(position(face[0]), position(face[1]), position(face[2]));
  }
  joins.copies = SplitPoints(stitcher, joins.faces);
  if (options.simplify_footprints > 0) {
    joins.edges = SortedEdges(joins.faces, static_cast<int32_t>(stitcher.vertices().size()));
  }
  return joins;
}

// What of the joins concerns one part.
PartJoins JoinsOfPart(const PartBorders& borders, const Joins& joins, size_t index) {
  const PartBorders::Part& part = borders.parts[index];
  const int32_t end = borders.parts[index + 1].first_border;
  PartJoins of_part = {.small = joins.small.data() + part.first_component};
  for (int32_t v = part.first_border; v < end; ++v) {
    const std::optional<SeamOffset>& offset = joins.offsets[static_cast<size_t>(v)];
    if (offset.has_value()) of_part.offsets.push_back(*offset);
  }
  const auto vertex = [&](int32_t v) { return static_cast<uint32_t>(borders.origins[static_cast<size_t>(v)].vertex); };
  auto edge = std::ranges::lower_bound(joins.edges, std::pair(part.first_border, int32_t{0}));
  for (; edge != joins.edges.end() && edge->first < end; ++edge) {
    if (edge->second < part.first_border || edge->second >= end) continue;
    of_part.edges.emplace_back(vertex(edge->first), vertex(edge->second));
  }
  return of_part;
}

// Writes parts one behind the other and remembers where their borders' vertices are.
class PartWriter {
 public:
  PartWriter(const PartBorders& borders, const Joins& joins, PlyStreamWriter& writer)
      : borders_(borders),
        joins_(joins),
        writer_(writer),
        index_of_border_(borders.origins.size() + joins.copies.size(), 0),
        is_copied_(borders.origins.size(), 0) {
    for (const int32_t v : joins.copies) is_copied_[static_cast<size_t>(v)] = 1;
  }

  absl::Status Append(int64_t part, const FinishedPart& finished) {
    const auto end = borders_.parts[static_cast<size_t>(part) + 1].first_border;
    for (int32_t border = borders_.parts[static_cast<size_t>(part)].first_border; border < end; ++border) {
      const auto v = static_cast<size_t>(border);
      const int32_t at = finished.index[static_cast<size_t>(borders_.origins[v].vertex)];
      if (at < 0) continue;
      index_of_border_[v] = static_cast<uint32_t>(writer_.vertices() + at);
      if (is_copied_[v] == 0) continue;
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
    faces.reserve(joins_.faces.size());
    for (const auto& face : joins_.faces) {
      std::array<uint32_t, 3>& corners = faces.emplace_back();
      for (size_t k = 0; k < 3; ++k) corners[k] = index_of_border_[static_cast<size_t>(face[k])];
    }
    return writer_.AppendFaces(faces);
  }

 private:
  const PartBorders& borders_;
  const Joins& joins_;
  PlyStreamWriter& writer_;
  std::vector<uint32_t> index_of_border_;  // and of the copies, in the file
  std::vector<uint8_t> is_copied_;
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
  return absl::OkStatus();
}

absl::StatusOr<JoinedMeshCounts> WriteJoinedMesh(int64_t count, const LoadSurface& load, const JoinOptions& options,
                                                 const Eigen::Vector3d& offset, const std::string& path,
                                                 ThreadPool& pool, const JoinListener& listener) {
  MW_RETURN_IF_ERROR(options.Validate());
  JoinedMeshCounts counts;
  JoinProgress progress(listener);
  MW_ASSIGN_OR_RETURN(PartBorders borders, FindPartBorders(count, load, pool, progress));
  counts.border_edges_before = static_cast<int64_t>(borders.vertices.size());
  std::vector<int64_t> patches;
  for (size_t i = 0; i < static_cast<size_t>(count); ++i) {
    const std::vector<bool>& trimmed = borders.parts[i].trimmed;
    patches.push_back(static_cast<int64_t>(trimmed.size()));
    counts.patches_trimmed += std::ranges::count(trimmed, true);
  }
  MW_ASSIGN_OR_RETURN(const Joins joins, JoinBorders(borders, options, load, pool, progress, counts));
  borders.vertices = {};
  borders.inner = {};
  borders.inner_edges = {};

  MW_ASSIGN_OR_RETURN(PlyStreamWriter writer, PlyStreamWriter::Create(path, AttributesWith(offset)));
  PartWriter part_writer(borders, joins, writer);
  for (const auto& [first, last] : BatchesOfParts(patches)) {
    std::vector<FinishedPart> parts(static_cast<size_t>(last - first));
    MW_RETURN_IF_ERROR(ForEachPart(first, last, pool, [&, first = first](int64_t i) -> absl::Status {
      const auto index = static_cast<size_t>(i);
      MW_ASSIGN_OR_RETURN(const std::shared_ptr<const SparseSurface> surface, load(i));
      parts[static_cast<size_t>(i - first)] =
          FinishPart(*surface, borders.parts[index], JoinsOfPart(borders, joins, index), options.blend_steps,
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
  }
  MW_RETURN_IF_ERROR(part_writer.AppendJoins());
  MW_RETURN_IF_ERROR(writer.Commit());
  counts.vertices = writer.vertices();
  counts.faces = writer.faces();
  return counts;
}

}  // namespace meshwright
