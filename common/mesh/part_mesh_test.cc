// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/part_mesh.h"

#include <set>
#include <utility>

#include <gtest/gtest.h>

#include "common/surface/random_surface_testing.h"
#include "common/surface/triangulation.h"

namespace meshwright {
namespace {

TEST(PartMeshTest, HasTheSurfacesTrianglesThatTouchNoRemovedPatch) {
  for (uint32_t seed = 0; seed < 20; ++seed) {
    const SparseSurface surface = SparseSurface::From(RandomSurface(seed, SmallCamera(23, 17), 1, 0.8, 0.8));
    std::vector<uint8_t> removed(surface.patches(), 0);
    for (size_t patch = seed; patch < removed.size(); patch += 7) removed[patch] = 1;
    const PartMesh mesh = BuildPartMesh(surface, removed);
    std::vector<std::array<int32_t, 3>> expected;
    for (const auto& triangle : Triangulate(surface)) {
      const auto gone = [&](int32_t patch) { return removed[static_cast<size_t>(patch)] != 0; };
      if (!gone(triangle[0]) && !gone(triangle[1]) && !gone(triangle[2])) expected.push_back(triangle);
    }
    std::vector<std::array<int32_t, 3>> found;
    for (const auto& face : mesh.faces) {
      found.push_back({mesh.patch_of_vertex[static_cast<size_t>(face[0])],
                       mesh.patch_of_vertex[static_cast<size_t>(face[1])],
                       mesh.patch_of_vertex[static_cast<size_t>(face[2])]});
    }
    EXPECT_EQ(found, expected);
  }
}

TEST(PartMeshTest, BorderIsTheEdgesWithOneTriangleInSimpleLoops) {
  for (uint32_t seed = 0; seed < 20; ++seed) {
    const SparseSurface surface = SparseSurface::From(RandomSurface(seed, SmallCamera(23, 17), 1, 0.75, 0.85));
    const PartMesh mesh = BuildPartMesh(surface, std::vector<uint8_t>(surface.patches(), 0));
    std::set<std::pair<int32_t, int32_t>> edges;
    for (const auto& face : mesh.faces) {
      for (size_t k = 0; k < 3; ++k) EXPECT_TRUE(edges.emplace(face[k], face[(k + 1) % 3]).second);
    }
    std::set<std::pair<int32_t, int32_t>> border;
    for (const auto& [from, to] : edges) {
      if (!edges.contains({to, from})) border.emplace(from, to);
    }
    std::set<std::pair<int32_t, int32_t>> found;
    std::set<int32_t> ends;
    for (size_t v = 0; v < mesh.next_on_border.size(); ++v) {
      if (mesh.next_on_border[v] == PartMesh::kInterior) continue;
      found.emplace(static_cast<int32_t>(v), mesh.next_on_border[v]);
      EXPECT_TRUE(ends.insert(mesh.next_on_border[v]).second);
    }
    EXPECT_EQ(found, border);
  }
}

TEST(PartMeshTest, ComponentsAreWhatEdgesConnect) {
  for (uint32_t seed = 0; seed < 10; ++seed) {
    const SparseSurface surface = SparseSurface::From(RandomSurface(seed, SmallCamera(23, 17), 1, 0.6, 0.8));
    const PartMesh mesh = BuildPartMesh(surface, std::vector<uint8_t>(surface.patches(), 0));
    std::vector<int64_t> faces(mesh.faces_of_component.size(), 0);
    for (const auto& face : mesh.faces) {
      const int32_t component = mesh.component_of_vertex[static_cast<size_t>(face[0])];
      ++faces[static_cast<size_t>(component)];
      for (const int32_t v : face) EXPECT_EQ(mesh.component_of_vertex[static_cast<size_t>(v)], component);
    }
    EXPECT_EQ(faces, mesh.faces_of_component);
  }
}

}  // namespace
}  // namespace meshwright
