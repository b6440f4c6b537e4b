// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/mesh_simplification.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <set>

#include <gtest/gtest.h>

#include "tools/raycast/mesh_ray_caster.h"

#include "common/mesh/triangle_mesh.h"

namespace meshwright {
namespace {

using Edge = std::pair<uint32_t, uint32_t>;

// A square of `side` x `side` vertices with distance 1 and z = height(x, y).
template <typename Height>
TriangleMesh Grid(uint32_t side, const Height& height) {
  TriangleMesh mesh;
  for (uint32_t y = 0; y < side; ++y) {
    for (uint32_t x = 0; x < side; ++x) mesh.positions.emplace_back(x, y, height(x, y));
  }
  for (uint32_t y = 0; y + 1 < side; ++y) {
    for (uint32_t x = 0; x + 1 < side; ++x) {
      const uint32_t v = y * side + x;
      mesh.faces.push_back({v, v + 1, v + side + 1});
      mesh.faces.push_back({v, v + side + 1, v + side});
    }
  }
  return mesh;
}

std::set<Edge> EdgesOf(const TriangleMesh& mesh) {
  std::set<Edge> edges;
  for (const auto& face : mesh.faces) {
    for (size_t k = 0; k < 3; ++k) EXPECT_TRUE(edges.emplace(face[k], face[(k + 1) % 3]).second);
  }
  return edges;
}

std::set<Edge> OpenEdgesOf(const TriangleMesh& mesh) {
  std::set<Edge> edges = EdgesOf(mesh);
  std::erase_if(edges, [all = edges](const Edge& edge) { return all.contains({edge.second, edge.first}); });
  return edges;
}

// By walking around every vertex: its triangles are one fan.
void ExpectOneFanAtEveryVertex(const TriangleMesh& mesh) {
  std::map<uint32_t, std::map<uint32_t, uint32_t>> around;  // vertex, next corner, the corner after that
  for (const auto& face : mesh.faces) {
    for (size_t k = 0; k < 3; ++k) around[face[k]][face[(k + 1) % 3]] = face[(k + 2) % 3];
  }
  for (const auto& [vertex, steps] : around) {
    std::set<uint32_t> ends;
    for (const auto& [from, to] : steps) ends.insert(to);
    auto start = std::ranges::find_if(steps, [&](const auto& step) { return !ends.contains(step.first); });
    if (start == steps.end()) start = steps.begin();
    size_t walked = 0;
    for (auto at = start; at != steps.end() && (at != start || walked == 0); at = steps.find(at->second)) ++walked;
    EXPECT_EQ(walked, steps.size()) << "vertex " << vertex;
  }
}

TriangleMesh Simplified(TriangleMesh mesh, double max_error, const std::vector<Edge>& other_edges = {}) {
  const std::set<Edge> open = OpenEdgesOf(mesh);
  mesh.faces = SimplifyFaces(mesh.positions, mesh.faces, max_error, other_edges);
  EXPECT_EQ(OpenEdgesOf(mesh), open);
  ExpectOneFanAtEveryVertex(mesh);
  return mesh;
}

struct Distances {
  double farthest = 0;
  double root_mean_square = 0;
};

Distances DistancesFrom(const TriangleMesh& mesh, const std::vector<Eigen::Vector3f>& points) {
  const MeshRayCaster caster(mesh);
  Distances distances;
  double squares = 0;
  for (const Eigen::Vector3f& x : points) {
    const double distance = caster.Nearest(x.cast<double>(), 1000).distance;
    distances.farthest = std::max(distances.farthest, distance);
    squares += distance * distance;
  }
  distances.root_mean_square = std::sqrt(squares / static_cast<double>(points.size()));
  return distances;
}

TEST(SimplifyFacesTest, CurvedSurfaceStaysWithinTheErrorWithFewerFaces) {
  const TriangleMesh dome = Grid(81, [](double x, double y) { return 4 * std::sin(x / 16) * std::cos(y / 19); });
  size_t faces = dome.faces.size();
  for (const double error : {0.003, 0.01, 0.03, 0.1}) {
    const TriangleMesh mesh = Simplified(dome, error);
    EXPECT_LT(mesh.faces.size(), faces);
    faces = mesh.faces.size();
    const Distances distances = DistancesFrom(mesh, dome.positions);
    EXPECT_LT(distances.root_mean_square, error);
    EXPECT_LT(distances.farthest, 4 * error);
  }
  EXPECT_LT(faces, dome.faces.size() / 10);
}

TEST(SimplifyFacesTest, PlaneKeepsLittleMoreThanItsBorder) {
  const TriangleMesh plane = Grid(41, [](double x, double) { return 0.5 * x; });
  const TriangleMesh mesh = Simplified(plane, 1e-4);
  EXPECT_LT(mesh.faces.size(), 2 * OpenEdgesOf(plane).size());
  EXPECT_LT(DistancesFrom(mesh, plane.positions).farthest, 1e-4);
}

TEST(SimplifyFacesTest, RoughSurfaceKeepsItsTopologyHoweverLargeTheError) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (int round = 0; round < 20; ++round) {
    TriangleMesh rough = Grid(24, [&](double, double) { return 0.3 * round * unit(random); });
    const size_t faces = rough.faces.size();
    // Holes, none of which touches another or the border in a point.
    for (uint32_t hole = 1; hole < 4; ++hole) {
      const uint32_t v = 24 * 6 * hole + 3 + static_cast<uint32_t>(round % 15);
      std::erase_if(rough.faces, [&](const auto& face) { return std::ranges::count(face, v) != 0; });
    }
    EXPECT_LT(Simplified(rough, 10).faces.size(), faces / 2);
  }
}

TEST(SimplifyFacesTest, EdgesOfOthersAreNotMadeAgain) {
  const TriangleMesh plane = Grid(21, [](double, double) { return 0; });
  std::set<Edge> before = EdgesOf(plane);
  std::vector<Edge> taken;
  for (const Edge& edge : EdgesOf(Simplified(plane, 0.1))) {
    const bool on_border = std::ranges::all_of(std::vector{edge.first, edge.second}, [](uint32_t v) {
      return v % 21 == 0 || v % 21 == 20 || v / 21 == 0 || v / 21 == 20;
    });
    if (on_border && !before.contains(edge)) taken.push_back(edge);
  }
  ASSERT_GT(taken.size(), 10U);
  const std::set<Edge> after = EdgesOf(Simplified(plane, 0.1, taken));
  for (const Edge& edge : taken) EXPECT_FALSE(after.contains(edge)) << edge.first << " " << edge.second;
  EXPECT_LT(after.size(), before.size() / 2);
}

TEST(SimplifyFacesTest, NothingStaysNothing) {
  EXPECT_TRUE(SimplifyFaces({}, {}, 1, {}).empty());
  EXPECT_TRUE(SimplifyFaces({{0, 0, 0}}, {}, 1, {}).empty());
}

}  // namespace
}  // namespace meshwright
