// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/part_mesh.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include "common/base/check.h"
#include "common/mesh/disjoint_sets.h"
#include "common/surface/triangulation.h"

namespace meshwright {
namespace {

// A patch is a corner of at most 8 triangles.
constexpr size_t kMostFaces = 8;

// One triangle (v, to, from) seen from its corner v.
struct FaceAtPatch {
  int32_t face = 0;
  int corner = 0;
  int32_t to = 0;    // patch of the next corner
  int32_t from = 0;  // patch of the corner after that
  bool taken = false;
};

struct FacesAtPatch {
  std::array<FaceAtPatch, kMostFaces> at;
  size_t count = 0;

  FaceAtPatch* Find(int32_t FaceAtPatch::*end, int32_t patch) {
    for (size_t i = 0; i < count; ++i) {
      if (at[i].*end == patch) return &at[i];
    }
    return nullptr;
  }
};

std::vector<std::array<int32_t, 3>> RemainingTriangles(const SparseSurface& surface,
                                                       const std::vector<uint8_t>& removed) {
  std::vector<std::array<int32_t, 3>> triangles = Triangulate(surface);
  std::erase_if(triangles, [&](const std::array<int32_t, 3>& triangle) {
    return std::ranges::any_of(triangle, [&](int32_t patch) { return removed[static_cast<size_t>(patch)] != 0; });
  });
  return triangles;
}

void LabelComponents(PartMesh& mesh) {
  DisjointSets sets(mesh.patch_of_vertex.size());
  for (const auto& face : mesh.faces) {
    sets.Join(face[0], face[1]);
    sets.Join(face[0], face[2]);
  }
  const size_t vertices = mesh.patch_of_vertex.size();
  mesh.component_of_vertex.resize(vertices);
  std::vector<int32_t> component_of_root(vertices, -1);
  for (size_t v = 0; v < vertices; ++v) {
    int32_t& component = component_of_root[static_cast<size_t>(sets.Root(static_cast<int32_t>(v)))];
    if (component < 0) {
      component = static_cast<int32_t>(mesh.faces_of_component.size());
      mesh.faces_of_component.push_back(0);
    }
    mesh.component_of_vertex[v] = component;
  }
  for (const auto& face : mesh.faces) {
    ++mesh.faces_of_component[static_cast<size_t>(mesh.component_of_vertex[static_cast<size_t>(face[0])])];
  }
}

}  // namespace

PartMesh BuildPartMesh(const SparseSurface& surface, const std::vector<uint8_t>& removed) {
  MW_CHECK(removed.size() == surface.patches());
  const std::vector<std::array<int32_t, 3>> triangles = RemainingTriangles(surface, removed);

  // Triangles at each patch: entries first[patch] .. first[patch + 1].
  const size_t patches = surface.patches();
  std::vector<int32_t> first(patches + 1, 0);
  for (const auto& triangle : triangles) {
    for (const int32_t patch : triangle) ++first[static_cast<size_t>(patch) + 1];
  }
  for (size_t patch = 0; patch < patches; ++patch) first[patch + 1] += first[patch];
  std::vector<int32_t> corner_at(3 * triangles.size());  // 3 * triangle + corner
  std::vector<int32_t> fill(first.begin(), first.end() - 1);
  for (size_t f = 0; f < triangles.size(); ++f) {
    for (size_t k = 0; k < 3; ++k) {
      corner_at[static_cast<size_t>(fill[static_cast<size_t>(triangles[f][k])]++)] = static_cast<int32_t>(3 * f + k);
    }
  }

  PartMesh mesh;
  mesh.faces.resize(triangles.size());
  std::vector<std::pair<int32_t, int32_t>> border_corners;  // vertex, corner of the face that its border edge ends in
  for (size_t patch = 0; patch < patches; ++patch) {
    FacesAtPatch around;
    for (int32_t i = first[patch]; i < first[patch + 1]; ++i) {
      const int32_t corner = corner_at[static_cast<size_t>(i)];
      const auto& triangle = triangles[static_cast<size_t>(corner / 3)];
      MW_CHECK(around.count < kMostFaces);
      around.at[around.count++] = {.face = corner / 3,
                                   .corner = corner % 3,
                                   .to = triangle[static_cast<size_t>((corner + 1) % 3)],
                                   .from = triangle[static_cast<size_t>((corner + 2) % 3)]};
    }
    for (size_t left = around.count; left > 0;) {
      // A fan with a border starts with the triangle that has no neighbour before it; a closed one anywhere.
      FaceAtPatch* start = nullptr;
      bool open = false;
      for (size_t i = 0; i < around.count && !open; ++i) {
        FaceAtPatch& face = around.at[i];
        if (face.taken) continue;
        open = around.Find(&FaceAtPatch::from, face.to) == nullptr;
        if (open || start == nullptr) start = &face;
      }
      const auto vertex = static_cast<int32_t>(mesh.patch_of_vertex.size());
      mesh.patch_of_vertex.push_back(static_cast<int32_t>(patch));
      mesh.next_on_border.push_back(PartMesh::kInterior);
      if (open) border_corners.emplace_back(vertex, 3 * start->face + (start->corner + 1) % 3);
      for (FaceAtPatch* face = start; face != nullptr && !face->taken; --left) {
        face->taken = true;
        mesh.faces[static_cast<size_t>(face->face)][static_cast<size_t>(face->corner)] = vertex;
        face = around.Find(&FaceAtPatch::to, face->from);
      }
    }
  }
  for (const auto& [vertex, corner] : border_corners) {
    mesh.next_on_border[static_cast<size_t>(vertex)] =
        mesh.faces[static_cast<size_t>(corner / 3)][static_cast<size_t>(corner % 3)];
  }
  LabelComponents(mesh);
  return mesh;
}

}  // namespace meshwright
