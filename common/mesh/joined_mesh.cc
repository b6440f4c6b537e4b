#include "common/mesh/joined_mesh.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <deque>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>

#include "common/base/check.h"
#include "common/base/status_macros.h"
#include "common/geometry/level_of_detail.h"
#include "common/mesh/border_stitching.h"
#include "common/mesh/disjoint_sets.h"
#include "common/mesh/part_mesh.h"
#include "common/mesh/ply.h"
#include "common/mesh/seam_blending.h"
#include "common/mesh/surface_overlap.h"

namespace meshwright {
namespace {

constexpr PlyAttributes kAttributes = {.normals = true, .colors = true, .quality = true, .cameras = true};
constexpr double kOverlapSteps = 3;  // the radius of support in section 3.7
// Seams are one or two steps wide; the circle through their corners is a little larger.
constexpr double kStitchReach = 2;
// Steep patches lie further apart than d_r, but not more than this many times.
constexpr float kMostSpacing = 4;
// Offsets at a seam are averaged over this many vertices to either side, so that texture does not smear.
constexpr int kSeamSmoothing = 8;
// Nodes of earlier surfaces kept to compare with (about 25 bytes each).
constexpr int64_t kMostCachedNodes = 4'000'000;

// What is kept of every part while all are joined.
struct Part {
  std::vector<bool> trimmed;    // per patch, in the order of the nodes
  int32_t first_border = 0;     // of its vertices in the stitcher
  int32_t first_component = 0;  // of its components
};

struct BorderOrigin {
  int32_t vertex = 0;     // of its part
  int32_t node = 0;       // of its part's lattice
  int32_t component = 0;  // of all parts
  std::array<uint8_t, 3> color = {};
};

// Everything that is known of the parts after they have been looked at one by one.
struct Borders {
  std::vector<Part> parts;  // and one more, which holds the ends
  std::vector<BorderVertex> vertices;
  std::vector<BorderOrigin> origins;
  std::vector<std::pair<int32_t, int32_t>> inner_edges;
  std::vector<int64_t> faces_of_component;
};

Eigen::Vector3f PointOf(const PatchLattice& surface, int32_t node) {
  return surface.Point(node % surface.lattice.columns, node / surface.lattice.columns).cast<float>();
}

std::vector<bool> TrimmedPatches(const PatchLattice& surface, const std::vector<uint8_t>& removed) {
  std::vector<bool> trimmed;
  for (size_t node = 0; node < removed.size(); ++node) {
    if (surface.depth[node] > 0) trimmed.push_back(removed[node] != 0);
  }
  return trimmed;
}

std::vector<uint8_t> RemovedNodes(const PatchLattice& surface, const std::vector<bool>& trimmed) {
  std::vector<uint8_t> removed(surface.depth.size(), 0);
  size_t patch = 0;
  for (size_t node = 0; node < removed.size(); ++node) {
    if (surface.depth[node] > 0) removed[node] = trimmed[patch++] ? 1 : 0;
  }
  return removed;
}

// Earlier surfaces, the last used ones in memory.
class CoveringSurfaces {
 public:
  explicit CoveringSurfaces(const LoadSurface& load) : load_(load) {}

  absl::StatusOr<std::shared_ptr<const CoveringSurface>> Get(int64_t index) {
    const auto at = std::ranges::find(kept_, index, [](const auto& entry) { return entry.first; });
    if (at != kept_.end()) {
      std::rotate(kept_.begin(), at, at + 1);
      return kept_.front().second;
    }
    MW_ASSIGN_OR_RETURN(PatchLattice surface, load_(index));
    auto cover = std::make_shared<const CoveringSurface>(std::move(surface));
    kept_.emplace_front(index, cover);
    nodes_ += cover->surface.lattice.nodes();
    while (kept_.size() > 1 && nodes_ > kMostCachedNodes) {
      nodes_ -= kept_.back().second->surface.lattice.nodes();
      kept_.pop_back();
    }
    return cover;
  }

 private:
  const LoadSurface& load_;
  std::deque<std::pair<int64_t, std::shared_ptr<const CoveringSurface>>> kept_;  // last used first
  int64_t nodes_ = 0;
};

void AddBorders(const PatchLattice& surface, const PartMesh& mesh, Borders& borders) {
  const auto first_border = static_cast<int32_t>(borders.vertices.size());
  const auto first_component = static_cast<int32_t>(borders.faces_of_component.size());
  std::vector<int32_t> border_of_vertex(mesh.node_of_vertex.size(), -1);
  for (size_t v = 0; v < mesh.node_of_vertex.size(); ++v) {
    if (mesh.next_on_border[v] == PartMesh::kInterior) continue;
    const int32_t node = mesh.node_of_vertex[v];
    border_of_vertex[v] = static_cast<int32_t>(borders.vertices.size());
    borders.vertices.push_back({.position = PointOf(surface, node),
                                .normal = surface.normal_in_world[static_cast<size_t>(node)],
                                .spacing = static_cast<float>(LevelOfDetail(
                                    surface.camera, surface.depth[static_cast<size_t>(node)], surface.lattice.step))});
    borders.origins.push_back({.vertex = static_cast<int32_t>(v),
                               .node = node,
                               .component = first_component + mesh.component_of_vertex[v],
                               .color = surface.rgb[static_cast<size_t>(node)]});
  }
  std::vector<float> spacing(borders.vertices.size() - static_cast<size_t>(first_border));
  for (size_t i = 0; i < spacing.size(); ++i) spacing[i] = borders.vertices[first_border + i].spacing;
  for (size_t i = static_cast<size_t>(first_border); i < borders.vertices.size(); ++i) {
    BorderVertex& vertex = borders.vertices[i];
    const auto next_vertex = static_cast<size_t>(mesh.next_on_border[static_cast<size_t>(borders.origins[i].vertex)]);
    vertex.next = border_of_vertex[next_vertex];
    const float length = (vertex.position - borders.vertices[static_cast<size_t>(vertex.next)].position).norm();
    for (const size_t end : {i, static_cast<size_t>(vertex.next)}) {
      float& s = spacing[end - static_cast<size_t>(first_border)];
      s = std::max(s, std::min(length, kMostSpacing * borders.vertices[end].spacing));
    }
  }
  for (size_t i = 0; i < spacing.size(); ++i) borders.vertices[first_border + i].spacing = spacing[i];
  for (const auto& face : mesh.faces) {
    for (size_t k = 0; k < 3; ++k) {
      const auto v = static_cast<size_t>(face[k]);
      const auto w = static_cast<size_t>(face[(k + 1) % 3]);
      if (v < w && border_of_vertex[v] >= 0 && border_of_vertex[w] >= 0 &&
          mesh.next_on_border[v] != static_cast<int32_t>(w)) {
        borders.inner_edges.emplace_back(border_of_vertex[v], border_of_vertex[w]);
      }
    }
  }
  borders.faces_of_component.insert(borders.faces_of_component.end(), mesh.faces_of_component.begin(),
                                    mesh.faces_of_component.end());
}

absl::StatusOr<Borders> LookAtParts(int64_t count, const LoadSurface& load, ThreadPool& pool,
                                    JoinedMeshCounts& counts) {
  Borders borders;
  std::vector<SurfaceOutline> outlines;
  CoveringSurfaces earlier(load);
  for (int64_t index = 0; index < count; ++index) {
    MW_ASSIGN_OR_RETURN(const std::shared_ptr<const CoveringSurface> current, earlier.Get(index));
    const PatchLattice& surface = current->surface;
    outlines.emplace_back(surface);
    std::vector<uint8_t> removed(surface.depth.size(), 0);
    for (int64_t other = 0; other < index; ++other) {
      if (!outlines.back().MayOverlap(outlines[static_cast<size_t>(other)], kOverlapSteps)) continue;
      MW_ASSIGN_OR_RETURN(const std::shared_ptr<const CoveringSurface> cover, earlier.Get(other));
      MarkCovered(surface, *cover, kOverlapSteps, pool, removed);
    }
    counts.patches_trimmed += std::ranges::count(removed, 1);
    borders.parts.push_back({.trimmed = TrimmedPatches(surface, removed),
                             .first_border = static_cast<int32_t>(borders.vertices.size()),
                             .first_component = static_cast<int32_t>(borders.faces_of_component.size())});
    AddBorders(surface, BuildPartMesh(surface, removed), borders);
  }
  borders.parts.push_back({.first_border = static_cast<int32_t>(borders.vertices.size()),
                           .first_component = static_cast<int32_t>(borders.faces_of_component.size())});
  counts.border_edges_before = static_cast<int64_t>(borders.vertices.size());
  return borders;
}

// Border vertices of triangles without neighbours. They are noise, and to a stitcher their outside looks like a hole.
std::vector<uint8_t> LoneTriangles(const Borders& borders) {
  std::vector<uint8_t> lone(borders.origins.size());
  for (size_t v = 0; v < lone.size(); ++v) {
    lone[v] = borders.faces_of_component[static_cast<size_t>(borders.origins[v].component)] == 1 ? 1 : 0;
  }
  return lone;
}

// Per component of a part: whether what it is stitched to has too few faces. A lone triangle always has.
std::vector<uint8_t> SmallComponents(const Borders& borders, const std::vector<BorderStitcher::Face>& faces,
                                     int64_t min_faces, int64_t& removed) {
  const size_t components = borders.faces_of_component.size();
  DisjointSets sets(components);
  std::vector<int64_t> total(components, 0);
  const auto component_of = [&](int32_t v) { return borders.origins[static_cast<size_t>(v)].component; };
  for (const auto& face : faces) {
    sets.Join(component_of(face[0]), component_of(face[1]));
    sets.Join(component_of(face[0]), component_of(face[2]));
  }
  const auto root_of = [&](size_t c) { return static_cast<size_t>(sets.Root(static_cast<int32_t>(c))); };
  for (size_t c = 0; c < components; ++c) total[root_of(c)] += borders.faces_of_component[c];
  for (const auto& face : faces) ++total[root_of(static_cast<size_t>(component_of(face[0])))];
  std::vector<uint8_t> small(components, 0);
  for (size_t c = 0; c < components; ++c) {
    small[c] = total[root_of(c)] < std::max<int64_t>(min_faces, 2) ? 1 : 0;
    if (small[c] != 0 && root_of(c) == c) ++removed;
  }
  return small;
}

// Half of what separates each vertex from those of other parts that it is stitched to.
std::vector<std::optional<SeamOffset>> SeamOffsets(const Borders& borders, const std::vector<BorderVertex>& vertices,
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
    offsets[v] = SeamOffset{borders.origins[v].node, total};
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

// The part without the components that `small` marks. `index` gets each vertex's place in it, -1 for none.
TriangleMesh MeshOfPart(const PatchLattice& surface, const PartMesh& part, const uint8_t* small,
                        std::vector<int32_t>& index) {
  TriangleMesh mesh;
  index.assign(part.node_of_vertex.size(), -1);
  for (size_t v = 0; v < index.size(); ++v) {
    if (small[part.component_of_vertex[v]] != 0) continue;
    index[v] = static_cast<int32_t>(mesh.positions.size());
    const int32_t node = part.node_of_vertex[v];
    mesh.positions.push_back(PointOf(surface, node));
    mesh.normals.push_back(surface.normal_in_world[static_cast<size_t>(node)]);
    mesh.colors.push_back(surface.rgb[static_cast<size_t>(node)]);
    mesh.quality.push_back(surface.quality[static_cast<size_t>(node)]);
  }
  mesh.cameras.assign(mesh.positions.size(), surface.camera_index);
  for (const auto& face : part.faces) {
    if (index[static_cast<size_t>(face[0])] < 0) continue;
    std::array<uint32_t, 3> corners = {};
    for (size_t k = 0; k < 3; ++k) corners[k] = static_cast<uint32_t>(index[static_cast<size_t>(face[k])]);
    mesh.faces.push_back(corners);
  }
  return mesh;
}

}  // namespace

absl::Status JoinOptions::Validate() const {
  if (min_component_faces < 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("min_component_faces is ", min_component_faces, ", expected at least 0"));
  }
  if (!(max_hole_steps >= 0 && max_hole_steps <= 1000)) {
    return absl::InvalidArgumentError(absl::StrCat("max_hole_steps is ", max_hole_steps, ", expected 0 to 1000"));
  }
  if (blend_steps < 0 || blend_steps > 1000) {
    return absl::InvalidArgumentError(absl::StrCat("blend_steps is ", blend_steps, ", expected 0 to 1000"));
  }
  return absl::OkStatus();
}

absl::StatusOr<JoinedMeshCounts> WriteJoinedMesh(int64_t count, const LoadSurface& load, const JoinOptions& options,
                                                 const std::string& path, ThreadPool& pool) {
  MW_RETURN_IF_ERROR(options.Validate());
  JoinedMeshCounts counts;
  MW_ASSIGN_OR_RETURN(Borders borders, LookAtParts(count, load, pool, counts));

  BorderStitcher stitcher(std::move(borders.vertices), borders.inner_edges);
  borders.inner_edges = {};
  stitcher.Drop(LoneTriangles(borders));
  stitcher.StitchNearby(kStitchReach);
  const std::vector<uint8_t> small =
      SmallComponents(borders, stitcher.faces(), options.min_component_faces, counts.components_removed);
  std::vector<uint8_t> drop(borders.origins.size());
  for (size_t v = 0; v < drop.size(); ++v) drop[v] = small[static_cast<size_t>(borders.origins[v].component)];
  stitcher.Drop(drop);
  const size_t stitch_faces = stitcher.faces().size();
  counts.holes_filled = stitcher.FillHoles(options.max_hole_steps);
  counts.border_edges_after = stitcher.CountOpenEdges();

  std::vector<BorderStitcher::Face> faces = stitcher.faces();
  std::vector<uint8_t> is_stitch(faces.size(), 0);
  std::fill(is_stitch.begin(), is_stitch.begin() + static_cast<int64_t>(stitch_faces), 1);
  const std::vector<std::optional<SeamOffset>> offsets = SeamOffsets(borders, stitcher.vertices(), faces, is_stitch);
  for (size_t f = 0; f < faces.size(); ++f) {
    if (drop[static_cast<size_t>(faces[f][0])] == 0) ++(is_stitch[f] != 0 ? counts.stitch_faces : counts.hole_faces);
  }
  std::erase_if(faces, [&](const BorderStitcher::Face& face) { return drop[static_cast<size_t>(face[0])] != 0; });
  const std::vector<int32_t> copies = SplitPoints(stitcher, faces);

  MW_ASSIGN_OR_RETURN(PlyStreamWriter writer, PlyStreamWriter::Create(path, kAttributes));
  std::vector<uint32_t> index_of_border(borders.origins.size() + copies.size(), 0);
  std::vector<int32_t> copied(borders.origins.size(), 0);
  for (const int32_t v : copies) ++copied[static_cast<size_t>(v)];
  TriangleMesh copied_vertices;
  std::vector<int32_t> copied_borders;
  for (int64_t i = 0; i < count; ++i) {
    const Part& part = borders.parts[static_cast<size_t>(i)];
    MW_ASSIGN_OR_RETURN(PatchLattice surface, load(i));
    const PartMesh part_mesh = BuildPartMesh(surface, RemovedNodes(surface, part.trimmed));
    const auto end = static_cast<size_t>(borders.parts[static_cast<size_t>(i) + 1].first_border);
    std::vector<SeamOffset> part_offsets;
    for (auto v = static_cast<size_t>(part.first_border); v < end; ++v) {
      if (offsets[v].has_value()) part_offsets.push_back(*offsets[v]);
    }
    BlendSeams(part_offsets, options.blend_steps, surface);
    std::vector<int32_t> index;
    const TriangleMesh mesh = MeshOfPart(surface, part_mesh, small.data() + part.first_component, index);
    for (auto v = static_cast<size_t>(part.first_border); v < end; ++v) {
      const int32_t at = index[static_cast<size_t>(borders.origins[v].vertex)];
      if (at < 0) continue;
      index_of_border[v] = static_cast<uint32_t>(writer.vertices() + at);
      if (copied[v] == 0) continue;
      AppendVertex(mesh, static_cast<size_t>(at), copied_vertices);
      copied_borders.push_back(static_cast<int32_t>(v));
    }
    MW_RETURN_IF_ERROR(writer.Append(mesh));
  }
  TriangleMesh copy_mesh;
  for (size_t c = 0; c < copies.size(); ++c) {
    const auto at = std::ranges::lower_bound(copied_borders, copies[c]) - copied_borders.begin();
    index_of_border[borders.origins.size() + c] = static_cast<uint32_t>(writer.vertices() + c);
    AppendVertex(copied_vertices, static_cast<size_t>(at), copy_mesh);
  }
  MW_RETURN_IF_ERROR(writer.Append(copy_mesh));
  std::vector<std::array<uint32_t, 3>> joining;
  joining.reserve(faces.size());
  for (const auto& face : faces) {
    joining.push_back({index_of_border[static_cast<size_t>(face[0])], index_of_border[static_cast<size_t>(face[1])],
                       index_of_border[static_cast<size_t>(face[2])]});
  }
  MW_RETURN_IF_ERROR(writer.AppendFaces(joining));
  MW_RETURN_IF_ERROR(writer.Commit());
  counts.vertices = writer.vertices();
  counts.faces = writer.faces();
  return counts;
}

}  // namespace meshwright
