// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/part_borders.h"

#include <algorithm>
#include <cstddef>
#include <memory>

#include "common/base/lru_cache.h"
#include "common/base/status_macros.h"
#include "common/geometry/level_of_detail.h"
#include "common/mesh/part_mesh.h"
#include "common/mesh/surface_overlap.h"

namespace meshwright {
namespace {

constexpr double kOverlapSteps = 3;  // the radius of support in section 3.7
// Steep patches lie further apart than d_r, but not more than this many times.
constexpr float kMostSpacing = 4;
// One sample for so many lattice steps in x and y.
constexpr int kSampleSteps = 8;
// Patches of parts worked on at the same time, some 150 bytes each.
constexpr int64_t kMostPatchesAtOnce = 1'000'000;

// Sketches kept while parts are compared with each other.
constexpr int64_t kSketchBytes = int64_t{64} << 20;

// What decides which surfaces have to be compared.
struct Sketch {
  SurfaceOutline outline;
  std::vector<bool> in_triangle;

  int64_t bytes() const { return outline.bytes() + static_cast<int64_t>(in_triangle.size() / 8); }
};
using Sketches = LruCache<int64_t, Sketch>;

// What is kept of every surface.
struct Extent {
  MeasuredSpace space;
  Lattice lattice;
};

// One part as if it were the first.
struct OnePart {
  PartBorders::Part part;
  std::vector<uint8_t> trimmed;
  std::vector<BorderVertex> vertices;
  std::vector<BorderOrigin> origins;
  std::vector<InnerSample> inner;
  std::vector<std::pair<int32_t, int32_t>> inner_edges;
  std::vector<int64_t> faces_of_component;
};

void FindBorder(const SparseSurface& surface, const PartMesh& mesh, OnePart& part) {
  std::vector<int32_t> border_of_vertex(mesh.patch_of_vertex.size(), -1);
  for (size_t v = 0; v < mesh.patch_of_vertex.size(); ++v) {
    if (mesh.next_on_border[v] == PartMesh::kInterior) continue;
    const auto patch = static_cast<size_t>(mesh.patch_of_vertex[v]);
    border_of_vertex[v] = static_cast<int32_t>(part.vertices.size());
    part.vertices.push_back(
        {.position = surface.Point(patch).cast<float>(),
         .normal = surface.normal_in_world[patch],
         .spacing = static_cast<float>(LevelOfDetail(surface.camera, surface.depth[patch], surface.lattice.step))});
    part.origins.push_back({.vertex = static_cast<int32_t>(v),
                            .patch = mesh.patch_of_vertex[v],
                            .component = mesh.component_of_vertex[v],
                            .color = surface.rgb[patch]});
  }
  std::vector<float> spacing(part.vertices.size());
  for (size_t i = 0; i < spacing.size(); ++i) spacing[i] = part.vertices[i].spacing;
  for (size_t i = 0; i < part.vertices.size(); ++i) {
    BorderVertex& vertex = part.vertices[i];
    const auto next_vertex = static_cast<size_t>(mesh.next_on_border[static_cast<size_t>(part.origins[i].vertex)]);
    vertex.next = border_of_vertex[next_vertex];
    const float length = (vertex.position - part.vertices[static_cast<size_t>(vertex.next)].position).norm();
    for (const size_t end : {i, static_cast<size_t>(vertex.next)}) {
      spacing[end] = std::max(spacing[end], std::min(length, kMostSpacing * part.vertices[end].spacing));
    }
  }
  for (size_t i = 0; i < spacing.size(); ++i) part.vertices[i].spacing = spacing[i];
  for (const auto& face : mesh.faces) {
    for (size_t k = 0; k < 3; ++k) {
      const auto v = static_cast<size_t>(face[k]);
      const auto w = static_cast<size_t>(face[(k + 1) % 3]);
      if (v < w && border_of_vertex[v] >= 0 && border_of_vertex[w] >= 0 &&
          mesh.next_on_border[v] != static_cast<int32_t>(w)) {
        part.inner_edges.emplace_back(border_of_vertex[v], border_of_vertex[w]);
      }
    }
  }
  std::ranges::sort(part.inner_edges);
  part.faces_of_component = mesh.faces_of_component;
}

// The first vertex of each tile of the lattice that is not on the border.
std::vector<InnerSample> SampleInside(const SparseSurface& surface, const PartMesh& mesh) {
  const int columns = surface.lattice.columns / kSampleSteps + 1;
  std::vector<bool> is_taken(static_cast<size_t>(columns) *
                             static_cast<size_t>(surface.lattice.rows / kSampleSteps + 1));
  std::vector<InnerSample> samples;
  for (size_t v = 0; v < mesh.patch_of_vertex.size(); ++v) {
    if (mesh.next_on_border[v] != PartMesh::kInterior) continue;
    const auto patch = static_cast<size_t>(mesh.patch_of_vertex[v]);
    const int tile = surface.Row(patch) / kSampleSteps * columns + surface.Column(patch) / kSampleSteps;
    if (is_taken[static_cast<size_t>(tile)]) continue;
    is_taken[static_cast<size_t>(tile)] = true;
    samples.push_back(
        {.position = surface.Point(patch).cast<float>(),
         .spacing = static_cast<float>(LevelOfDetail(surface.camera, surface.depth[patch], surface.lattice.step)),
         .component = mesh.component_of_vertex[v]});
  }
  return samples;
}

absl::StatusOr<OnePart> LookAtPart(int64_t index, const LoadSurface& load, const std::vector<Extent>& extents,
                                   Sketches& sketches, ThreadPool& pool) {
  MW_ASSIGN_OR_RETURN(const std::shared_ptr<const SparseSurface> surface, load(index));
  MW_ASSIGN_OR_RETURN(const std::shared_ptr<const Sketch> own, sketches.Get(index));
  std::vector<uint8_t> removed(surface->patches(), 0);
  for (int64_t other = 0; other < index; ++other) {
    const Extent& extent = extents[static_cast<size_t>(other)];
    if (!own->outline.MayOverlap(extent.space, extent.lattice, kOverlapSteps)) continue;
    MW_ASSIGN_OR_RETURN(const std::shared_ptr<const Sketch> sketch, sketches.Get(other));
    if (!own->outline.MayOverlap(sketch->outline, kOverlapSteps)) continue;
    MW_ASSIGN_OR_RETURN(const std::shared_ptr<const SparseSurface> cover, load(other));
    MarkCovered(*surface, *cover, sketch->in_triangle, kOverlapSteps, pool, removed);
  }
  OnePart part;
  part.part.camera_index = surface->camera_index;
  part.part.space = extents[static_cast<size_t>(index)].space;
  const PartMesh mesh = BuildPartMesh(*surface, removed);
  FindBorder(*surface, mesh, part);
  part.inner = SampleInside(*surface, mesh);
  part.trimmed = std::move(removed);
  return part;
}

// Numbers of one part become numbers of all parts.
void Append(OnePart part, PartBorders& borders) {
  const auto first_border = static_cast<int32_t>(borders.vertices.size());
  const auto first_component = static_cast<int32_t>(borders.faces_of_component.size());
  part.part.first_patch = static_cast<int64_t>(borders.trimmed.size());
  part.part.first_border = first_border;
  part.part.first_inner = static_cast<int32_t>(borders.inner.size());
  part.part.first_component = first_component;
  borders.parts.push_back(part.part);
  borders.trimmed.Append(part.trimmed);
  for (BorderVertex& vertex : part.vertices) {
    vertex.next += first_border;
    borders.vertices.push_back(vertex);
  }
  for (BorderOrigin& origin : part.origins) {
    origin.component += first_component;
    borders.origins.push_back(origin);
  }
  for (InnerSample& sample : part.inner) {
    sample.component += first_component;
    borders.inner.push_back(sample);
  }
  for (const auto& [v, w] : part.inner_edges) borders.inner_edges.push_back({first_border + v, first_border + w});
  borders.faces_of_component.insert(borders.faces_of_component.end(), part.faces_of_component.begin(),
                                    part.faces_of_component.end());
}

}  // namespace

PartBorders::PartBorders(const std::string& spool_beside)
    : spool_beside(spool_beside),
      trimmed(spool_beside),
      vertices(spool_beside),
      origins(spool_beside),
      inner(spool_beside),
      inner_edges(spool_beside) {}

size_t PartBorders::PartOf(int32_t border_vertex) const {
  const auto behind = std::ranges::upper_bound(parts, border_vertex, {}, &Part::first_border);
  return static_cast<size_t>(behind - parts.begin()) - 1;
}

absl::Span<const uint8_t> PartBorders::Trimmed(size_t part) const {
  const auto first = static_cast<size_t>(parts[part].first_patch);
  return absl::MakeConstSpan(trimmed.data() + first, static_cast<size_t>(parts[part + 1].first_patch) - first);
}

void PartBorders::Release() const {
  trimmed.Release();
  vertices.Release();
  origins.Release();
  inner.Release();
  inner_edges.Release();
}

absl::Status ForEachPart(int64_t first, int64_t last, ThreadPool& pool,
                         const std::function<absl::Status(int64_t)>& body) {
  std::vector<absl::Status> statuses(static_cast<size_t>(last - first));
  pool.ParallelFor(last - first, 1, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) statuses[static_cast<size_t>(i)] = body(first + i);
  });
  for (const absl::Status& status : statuses) MW_RETURN_IF_ERROR(status);
  return absl::OkStatus();
}

std::vector<std::pair<int64_t, int64_t>> BatchesOfParts(const std::vector<int64_t>& patches) {
  std::vector<std::pair<int64_t, int64_t>> batches;
  int64_t in_batch = 0;
  for (size_t i = 0; i < patches.size(); ++i) {
    if (batches.empty() || in_batch + patches[i] > kMostPatchesAtOnce) {
      batches.emplace_back(i, i);
      in_batch = 0;
    }
    batches.back().second = static_cast<int64_t>(i) + 1;
    in_batch += patches[i];
  }
  return batches;
}

absl::StatusOr<PartBorders> FindPartBorders(int64_t count, const LoadSurface& load, const std::string& spool_beside,
                                            ThreadPool& pool, JoinProgress& progress) {
  Sketches sketches(
      [&](int64_t i) -> absl::StatusOr<Sketch> {
        MW_ASSIGN_OR_RETURN(const std::shared_ptr<const SparseSurface> surface, load(i));
        return Sketch{SurfaceOutline(*surface), CornersOfTriangles(*surface)};
      },
      kSketchBytes);
  std::vector<Extent> extents(static_cast<size_t>(count));
  std::vector<int64_t> patches(static_cast<size_t>(count));
  MW_RETURN_IF_ERROR(ForEachPart(0, count, pool, [&](int64_t i) -> absl::Status {
    MW_ASSIGN_OR_RETURN(const std::shared_ptr<const SparseSurface> surface, load(i));
    extents[static_cast<size_t>(i)] = {MeasuredSpace::Of(*surface), surface->lattice};
    patches[static_cast<size_t>(i)] = static_cast<int64_t>(surface->patches());
    progress.Step(JoinStage::kSketching, count);
    return absl::OkStatus();
  }));
  PartBorders borders(spool_beside);
  for (const auto& [first, last] : BatchesOfParts(patches)) {
    std::vector<OnePart> parts(static_cast<size_t>(last - first));
    MW_RETURN_IF_ERROR(ForEachPart(first, last, pool, [&, first = first](int64_t i) -> absl::Status {
      MW_ASSIGN_OR_RETURN(parts[static_cast<size_t>(i - first)], LookAtPart(i, load, extents, sketches, pool));
      progress.Step(JoinStage::kLooking, count);
      return absl::OkStatus();
    }));
    for (OnePart& part : parts) Append(std::move(part), borders);
    borders.Release();
  }
  borders.parts.push_back({.first_patch = static_cast<int64_t>(borders.trimmed.size()),
                           .first_border = static_cast<int32_t>(borders.vertices.size()),
                           .first_inner = static_cast<int32_t>(borders.inner.size()),
                           .first_component = static_cast<int32_t>(borders.faces_of_component.size())});
  return borders;
}

}  // namespace meshwright
