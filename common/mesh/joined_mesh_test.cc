// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/joined_mesh.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "tools/raycast/mesh_ray_caster.h"

#include "common/base/files.h"
#include "common/mesh/disjoint_sets.h"
#include "common/mesh/ply.h"
#include "common/mesh/surface_mesh.h"
#include "common/surface/random_surface_testing.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;
using Keep = std::function<bool(double x, double y)>;

// A camera of 80 x 60 px at `center` (z > 0: above the plane z = 0, below it otherwise) that looks at `target`.
Camera LookAt(const Eigen::Vector3d& center, const Eigen::Vector3d& target, double roll) {
  Camera camera{80, 60, 80, 80, 40, 30, {}};
  const Eigen::Vector3d z = (target - center).normalized();
  const Eigen::Vector3d up(std::sin(roll), std::cos(roll), 0);
  const Eigen::Vector3d x = z.cross(up).normalized();
  camera.cam_from_world.rotation.row(0) = x.transpose();
  camera.cam_from_world.rotation.row(1) = z.cross(x).transpose();
  camera.cam_from_world.rotation.row(2) = z.transpose();
  camera.cam_from_world.translation = -(camera.cam_from_world.rotation * center);
  return camera;
}

// The part of the plane z = 0 that `keep` accepts, as the camera sees it. One lattice step is 1/40 at distance 1.
PatchLattice PlaneSeenBy(CameraIndex index, const Camera& camera, const Keep& keep, uint8_t grey = 128) {
  PatchLattice surface = PatchLattice::Empty(index, camera, 2);
  const Eigen::Vector3d center = camera.center_in_world();
  for (int row = 0; row < surface.lattice.rows; ++row) {
    for (int column = 0; column < surface.lattice.columns; ++column) {
      const Eigen::Vector2d pixel = surface.lattice.Pixel(column, row);
      const Eigen::Vector3d ray = camera.cam_from_world.rotation.transpose() * camera.RayInCam(pixel.x(), pixel.y());
      const double depth = -center.z() / ray.z();
      const Eigen::Vector3d x = center + depth * ray;
      if (!(depth > 0) || !keep(x.x(), x.y())) continue;
      const auto node = static_cast<size_t>(surface.lattice.Index(column, row));
      surface.depth[node] = static_cast<float>(depth);
      surface.normal_in_world[node] = Eigen::Vector3f(0, 0, center.z() > 0 ? 1 : -1);
      surface.quality[node] = 0.9F;
      surface.rgb[node] = {grey, grey, grey};
    }
  }
  for (int row = 0; row < surface.lattice.rows; ++row) {
    for (int column = 0; column < surface.lattice.columns; ++column) {
      const int64_t node = surface.lattice.Index(column, row);
      if (!surface.HasPatch(node)) continue;
      uint8_t& links = surface.links[static_cast<size_t>(node)];
      if (column + 1 < surface.lattice.columns && surface.HasPatch(node + 1)) links |= PatchLattice::kLinkRight;
      if (row + 1 < surface.lattice.rows && surface.HasPatch(node + surface.lattice.columns)) {
        links |= PatchLattice::kLinkDown;
      }
    }
  }
  return surface;
}

// The same rays, cut with waves around the plane, z = 0.04 sin(9 x) cos(7 y), instead.
PatchLattice BentToWaves(PatchLattice surface) {
  const Eigen::Vector3d center = surface.camera.center_in_world();
  for (int64_t node = 0; node < surface.lattice.nodes(); ++node) {
    if (!surface.HasPatch(node)) continue;
    const auto column = static_cast<int>(node % surface.lattice.columns);
    const auto row = static_cast<int>(node / surface.lattice.columns);
    float& depth = surface.depth[static_cast<size_t>(node)];
    for (int round = 0; round < 30; ++round) {
      const Eigen::Vector3d x = surface.Point(column, row);
      const double z = 0.04 * std::sin(9 * x.x()) * std::cos(7 * x.y());
      depth = static_cast<float>(depth * (z - center.z()) / (x.z() - center.z()));
    }
  }
  return surface;
}

// Three ragged surfaces on top of each other.
std::vector<PatchLattice> RandomParts(uint32_t seed, double density, double link_density) {
  std::vector<PatchLattice> surfaces;
  for (uint32_t i = 0; i < 3; ++i) {
    surfaces.push_back(RandomSurface(3 * seed + i, SmallCamera(37, 29), 1, density, link_density));
    for (float& depth : surfaces.back().depth) depth = depth > 0 ? 2 + 0.1F * depth : 0;
    for (auto& normal : surfaces.back().normal_in_world) normal = {0, 0, -1};
  }
  return surfaces;
}

double AreaOf(const TriangleMesh& mesh) {
  double area = 0;
  for (const auto& face : mesh.faces) {
    const Eigen::Vector3f& a = mesh.positions[face[0]];
    area += 0.5 * static_cast<double>((mesh.positions[face[1]] - a).cross(mesh.positions[face[2]] - a).norm());
  }
  return area;
}

std::shared_ptr<const SparseSurface> Sparse(const PatchLattice& surface) {
  return std::make_shared<const SparseSurface>(SparseSurface::From(surface));
}

bool Everywhere(double, double) { return true; }

// Closed or not, the triangles at a vertex are one fan.
void ExpectOneFanAtEachVertex(const TriangleMesh& mesh) {
  std::vector<std::map<uint32_t, uint32_t>> around(mesh.positions.size());  // from corner to corner, past a triangle
  for (const auto& face : mesh.faces) {
    for (size_t k = 0; k < 3; ++k) around[face[k]].emplace(face[(k + 1) % 3], face[(k + 2) % 3]);
  }
  for (size_t v = 0; v < around.size(); ++v) {
    if (around[v].empty()) continue;
    std::set<uint32_t> ends;
    for (const auto& [from, to] : around[v]) ends.insert(to);
    uint32_t first = around[v].begin()->first;
    for (const auto& [from, to] : around[v]) {
      if (!ends.contains(from)) first = from;
    }
    size_t passed = 0;
    for (auto at = around[v].find(first); at != around[v].end(); at = around[v].find(at->second)) {
      ++passed;
      if (at->second == first) break;
    }
    EXPECT_EQ(passed, around[v].size()) << "fans meet in vertex " << v;
  }
}

// The directed edges that have no partner, as a map from start to end. Checks that edges and faces are as promised.
std::map<uint32_t, uint32_t> BorderOf(const TriangleMesh& mesh) {
  std::set<std::pair<uint32_t, uint32_t>> edges;
  std::set<std::set<uint32_t>> faces;
  for (const auto& face : mesh.faces) {
    EXPECT_TRUE(faces.insert({face[0], face[1], face[2]}).second) << "a face is there twice";
    EXPECT_EQ(faces.count({face[0], face[1], face[2]}), 1U);
    for (size_t k = 0; k < 3; ++k) {
      EXPECT_NE(face[k], face[(k + 1) % 3]);
      EXPECT_TRUE(edges.emplace(face[k], face[(k + 1) % 3]).second) << "an edge is there twice in one direction";
    }
  }
  ExpectOneFanAtEachVertex(mesh);
  std::map<uint32_t, uint32_t> border;
  for (const auto& [from, to] : edges) {
    if (edges.contains({to, from})) continue;
    EXPECT_TRUE(border.emplace(from, to).second) << "two fans meet in a point";
  }
  return border;
}

// Ends of edges with one triangle, by position and colour, as vertices are numbered anew when some are left out.
std::multiset<std::vector<float>> RimOf(const TriangleMesh& mesh) {
  std::multiset<std::vector<float>> rim;
  for (const auto& [from, to] : BorderOf(mesh)) {
    std::vector<float> edge;
    for (const uint32_t v : {from, to}) {
      edge.insert(edge.end(), mesh.positions[v].begin(), mesh.positions[v].end());
      edge.insert(edge.end(), mesh.colors[v].begin(), mesh.colors[v].end());
    }
    rim.insert(edge);
  }
  return rim;
}

int CountLoops(std::map<uint32_t, uint32_t> border) {
  int loops = 0;
  for (; !border.empty(); ++loops) {
    for (auto at = border.begin(); at != border.end();) {
      const uint32_t next = at->second;
      border.erase(at);
      at = border.find(next);
    }
  }
  return loops;
}

int CountComponents(const TriangleMesh& mesh) {
  DisjointSets sets(mesh.positions.size());
  for (const auto& face : mesh.faces) {
    sets.Join(static_cast<int32_t>(face[0]), static_cast<int32_t>(face[1]));
    sets.Join(static_cast<int32_t>(face[0]), static_cast<int32_t>(face[2]));
  }
  std::set<int32_t> roots;
  for (size_t v = 0; v < mesh.positions.size(); ++v) roots.insert(sets.Root(static_cast<int32_t>(v)));
  return static_cast<int>(roots.size());
}

// How many triangles lie over point (x, y) of the plane z = 0, all of which face upwards.
int LayersAt(const TriangleMesh& mesh, double x, double y) {
  int layers = 0;
  for (const auto& face : mesh.faces) {
    bool inside = true;
    for (size_t k = 0; k < 3; ++k) {
      const Eigen::Vector2d a = mesh.positions[face[k]].head<2>().cast<double>();
      const Eigen::Vector2d b = mesh.positions[face[(k + 1) % 3]].head<2>().cast<double>();
      inside = inside && (b.x() - a.x()) * (y - a.y()) - (b.y() - a.y()) * (x - a.x()) >= 0;
    }
    layers += inside ? 1 : 0;
  }
  return layers;
}

class JoinedMeshTest : public testing::Test {
 protected:
  JoinedMeshTest()
      : folder_(fs::path(testing::TempDir()) / ("meshwright_joined_mesh_test_" + std::to_string(::getpid()))) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~JoinedMeshTest() override { fs::remove_all(folder_); }

  TriangleMesh Join(const std::vector<PatchLattice>& surfaces, const JoinOptions& options, int threads = 1) {
    ThreadPool pool(threads);
    const auto counts = WriteJoinedMesh(
        static_cast<int64_t>(surfaces.size()), [&](int64_t i) { return Sparse(surfaces[static_cast<size_t>(i)]); },
        options, Eigen::Vector3d::Zero(), Path(), pool);
    EXPECT_TRUE(counts.ok()) << counts.status();
    if (!counts.ok()) return {};
    counts_ = *counts;
    TriangleMesh mesh = *ReadPly(Path());
    const auto border = BorderOf(mesh);
    EXPECT_EQ(counts_.border_edges_after, static_cast<int64_t>(border.size()));
    EXPECT_EQ(counts_.vertices, static_cast<int64_t>(mesh.positions.size()));
    EXPECT_EQ(counts_.faces, static_cast<int64_t>(mesh.faces.size()));
    EXPECT_NEAR(counts_.area, AreaOf(mesh), 1e-4 * AreaOf(mesh));
    return mesh;
  }
  std::string Path() const { return (folder_ / "mesh.ply").string(); }

  fs::path folder_;
  JoinedMeshCounts counts_;
  const Camera left_ = LookAt({-0.4, 0, 1}, {-0.2, 0, 0}, 0.1);
  const Camera right_ = LookAt({0.5, 0.1, 1.2}, {0.2, 0, 0}, -0.2);
};

TEST_F(JoinedMeshTest, OneSurfaceIsItsTriangles) {
  const PatchLattice surface = PlaneSeenBy(4, left_, Everywhere);
  const TriangleMesh mesh = Join({surface}, {.min_component_faces = 0});
  const TriangleMesh alone = MeshOfSurface(surface);
  EXPECT_EQ(mesh.positions, alone.positions);
  EXPECT_EQ(mesh.faces, alone.faces);
  EXPECT_EQ(mesh.colors, alone.colors);
  EXPECT_EQ(mesh.cameras, alone.cameras);
  EXPECT_EQ(counts_.stitch_faces, 0);
}

TEST_F(JoinedMeshTest, WhateverTheSurfacesEdgesAreManifold) {
  for (uint32_t seed = 0; seed < 12; ++seed) {
    Join(RandomParts(seed, 0.5 + 0.04 * seed, 0.9), {.min_component_faces = static_cast<int64_t>(seed % 3) * 5});
    EXPECT_GT(counts_.stitch_faces, 0);
  }
}

TEST_F(JoinedMeshTest, PartsThatOverlapBecomeOneLayer) {
  const TriangleMesh mesh = Join({PlaneSeenBy(0, left_, Everywhere), PlaneSeenBy(1, right_, Everywhere)}, {});
  EXPECT_GT(counts_.patches_trimmed, 100);
  EXPECT_EQ(CountComponents(mesh), 1);
  EXPECT_EQ(CountLoops(BorderOf(mesh)), 1);
  for (double y = -0.2; y < 0.2; y += 0.0371) {
    for (double x = -0.55; x < 0.5; x += 0.0233) EXPECT_EQ(LayersAt(mesh, x, y), 1) << x << " " << y;
  }
  for (const auto& face : mesh.faces) {
    const Eigen::Vector3f& a = mesh.positions[face[0]];
    EXPECT_GT((mesh.positions[face[1]] - a).cross(mesh.positions[face[2]] - a).z(), 0);
  }
}

TEST_F(JoinedMeshTest, PartsThatTouchAreSewnTogether) {
  for (const double gap : {0.0, 0.02, 0.04}) {
    const TriangleMesh mesh = Join({PlaneSeenBy(0, left_, [&](double x, double) { return x < -gap / 2; }),
                                    PlaneSeenBy(1, right_, [&](double x, double) { return x > gap / 2; })},
                                   {});
    EXPECT_EQ(CountComponents(mesh), 1) << gap;
    EXPECT_EQ(CountLoops(BorderOf(mesh)), 1) << gap;
    for (double y = -0.2; y < 0.2; y += 0.0071) {
      EXPECT_EQ(LayersAt(mesh, 0.001, y), 1) << gap << " " << y;
    }
  }
}

TEST_F(JoinedMeshTest, WideGapStaysOpen) {
  const TriangleMesh mesh = Join({PlaneSeenBy(0, left_, [](double x, double) { return x < -0.1; }),
                                  PlaneSeenBy(1, right_, [](double x, double) { return x > 0.1; })},
                                 {});
  EXPECT_EQ(CountComponents(mesh), 2);
  for (double y = -0.2; y < 0.2; y += 0.0071) EXPECT_EQ(LayersAt(mesh, 0.001, y), 0) << y;
}

TEST_F(JoinedMeshTest, ThinWallKeepsBothSides) {
  const PatchLattice front = PlaneSeenBy(0, LookAt({0, 0, 1}, {0, 0, 0}, 0), Everywhere);
  const PatchLattice back = PlaneSeenBy(1, LookAt({0, 0, -1}, {0, 0, 0}, 0), Everywhere);
  const TriangleMesh mesh = Join({front, back}, {});
  EXPECT_EQ(counts_.patches_trimmed, 0);
  EXPECT_EQ(mesh.faces.size(), MeshOfSurface(front).faces.size() + MeshOfSurface(back).faces.size());
}

TEST_F(JoinedMeshTest, HolesUpToTheLimitAreClosedAndTheRimStays) {
  const Camera camera = LookAt({0, 0, 1}, {0, 0, 0}, 0);
  const PatchLattice full = PlaneSeenBy(0, camera, Everywhere);
  const Keep outside = [](double x, double y) { return std::hypot(x - 0.05, y) > 0.15; };  // 12 steps wide
  const TriangleMesh closed = Join({PlaneSeenBy(0, camera, outside)}, {.max_hole_steps = 20});
  EXPECT_EQ(counts_.holes_filled, 1);
  EXPECT_GT(counts_.hole_faces, 10);
  EXPECT_EQ(CountLoops(BorderOf(closed)), 1);
  EXPECT_EQ(BorderOf(closed).size(), BorderOf(MeshOfSurface(full)).size());
  for (double x = -0.2; x < 0.2; x += 0.0171) EXPECT_EQ(LayersAt(closed, x, 0.013), 1) << x;

  const TriangleMesh open = Join({PlaneSeenBy(0, camera, outside)}, {.max_hole_steps = 8});
  EXPECT_EQ(counts_.holes_filled, 0);
  EXPECT_EQ(CountLoops(BorderOf(open)), 2);
}

// Cameras from three sides see the plane but for a hole 12 steps wide.
std::vector<PatchLattice> PlaneWithHole() {
  const Keep outside = [](double x, double y) { return std::hypot(x, y) > 0.15; };
  std::vector<PatchLattice> surfaces;
  for (const Eigen::Vector3d& center : {Eigen::Vector3d(0, 0, 1), {0.3, 0.1, 1}, {-0.2, 0.2, 1}}) {
    surfaces.push_back(PlaneSeenBy(static_cast<CameraIndex>(surfaces.size()), LookAt(center, {0, 0, 0}, 0), outside));
  }
  return surfaces;
}

TEST_F(JoinedMeshTest, GapIsClosedWhereNoCameraLooksThrough) {
  const JoinOptions options = {.max_hole_steps = 0};
  const TriangleMesh closed = Join(PlaneWithHole(), options);
  EXPECT_GT(counts_.closing_faces, 10);
  EXPECT_EQ(CountLoops(BorderOf(closed)), 1);
  for (double x = -0.2; x < 0.2; x += 0.0171) EXPECT_EQ(LayersAt(closed, x, 0.013), 1) << x;

  const std::string bytes = *ReadFile(Path());
  Join(PlaneWithHole(), options, 3);
  EXPECT_TRUE(*ReadFile(Path()) == bytes) << "it depends on the number of threads";

  const TriangleMesh open = Join(PlaneWithHole(), {.max_hole_steps = 0, .close_reach = 0});
  EXPECT_EQ(counts_.closing_faces, 0);
  EXPECT_EQ(CountLoops(BorderOf(open)), 2);
  Join(PlaneWithHole(), {.max_hole_steps = 0, .close_reach = 0.01});
  EXPECT_EQ(counts_.closing_faces, 0) << "it is too large";
}

TEST_F(JoinedMeshTest, GapThatOneCameraAloneSeesStaysOpen) {
  const TriangleMesh mesh = Join({PlaneWithHole().front()}, {.max_hole_steps = 0});
  EXPECT_EQ(counts_.closing_faces, 0);
  EXPECT_EQ(CountLoops(BorderOf(mesh)), 2);
}

TEST_F(JoinedMeshTest, WindowThroughWhichSurfaceIsSeenStaysOpen) {
  std::vector<PatchLattice> surfaces = PlaneWithHole();
  for (PatchLattice& surface : surfaces) {
    const Eigen::Vector3d center = surface.camera.center_in_world();
    // What lies at z = -0.4 behind the window.
    for (int row = 0; row < surface.lattice.rows; ++row) {
      for (int column = 0; column < surface.lattice.columns; ++column) {
        const auto node = static_cast<size_t>(surface.lattice.Index(column, row));
        if (surface.depth[node] > 0) continue;
        const Eigen::Vector2d pixel = surface.lattice.Pixel(column, row);
        const Eigen::Vector3d ray =
            surface.camera.cam_from_world.rotation.transpose() * surface.camera.RayInCam(pixel.x(), pixel.y());
        surface.depth[node] = static_cast<float>((-0.4 - center.z()) / ray.z());
        surface.normal_in_world[node] = Eigen::Vector3f(0, 0, 1);
        surface.quality[node] = 0.9F;
      }
    }
  }
  const TriangleMesh mesh = Join(surfaces, {.min_component_faces = 0, .max_hole_steps = 0});
  for (const auto& face : mesh.faces) {
    Eigen::Vector3f middle = Eigen::Vector3f::Zero();
    for (const uint32_t v : face) middle += mesh.positions[v] / 3;
    EXPECT_FALSE(middle.head<2>().norm() < 0.1F && middle.z() > -0.2F) << "a triangle lies in the window";
  }
}

TEST_F(JoinedMeshTest, PiecesThatMeetInAPointAloneAreTwo) {
  // A crumb whose corner comes within a step of a plane's: a triangle to it would have its point alone.
  const Camera camera = LookAt({0, 0, 1}, {0, 0, 0}, 0);
  const Keep with_crumbs = [](double x, double y) {
    return x + y < 0 || std::hypot(x - 0.12, y - 0.12) < 0.09 || std::hypot(x - 0.2, y + 0.1) < 0.06;
  };
  const TriangleMesh mesh = Join({PlaneSeenBy(0, camera, with_crumbs)}, {.min_component_faces = 60});
  std::map<std::pair<uint32_t, uint32_t>, std::vector<int32_t>> at_edge;
  DisjointSets sets(mesh.faces.size());
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    for (size_t k = 0; k < 3; ++k) {
      auto& around = at_edge[std::minmax(mesh.faces[f][k], mesh.faces[f][(k + 1) % 3])];
      for (const int32_t other : around) sets.Join(other, static_cast<int32_t>(f));
      around.push_back(static_cast<int32_t>(f));
    }
  }
  std::map<int32_t, int> faces_of_piece;
  for (size_t f = 0; f < mesh.faces.size(); ++f) ++faces_of_piece[sets.Root(static_cast<int32_t>(f))];
  for (const auto& [root, faces] : faces_of_piece) EXPECT_GE(faces, 60);
}

TEST_F(JoinedMeshTest, IslandInAHoleBecomesPartOfTheFilling) {
  const Camera camera = LookAt({0, 0, 1}, {0, 0, 0}, 0);
  const TriangleMesh mesh = Join({PlaneSeenBy(0, camera,
                                              [](double x, double y) {
                                                const double radius = std::hypot(x, y);
                                                return radius > 0.22 || radius < 0.07;
                                              })},
                                 {.min_component_faces = 10, .max_hole_steps = 30});
  EXPECT_EQ(CountComponents(mesh), 1);
  EXPECT_EQ(CountLoops(BorderOf(mesh)), 1);
  for (double x = -0.3; x < 0.3; x += 0.0171) EXPECT_EQ(LayersAt(mesh, x, 0.013), 1) << x;
}

TEST_F(JoinedMeshTest, PiecesBelowTheThresholdVanish) {
  const Camera camera = LookAt({0, 0, 1}, {0, 0, 0}, 0);
  const Keep with_islands = [](double x, double y) {
    return x < 0 || std::hypot(x - 0.3, y - 0.15) < 0.06 || std::hypot(x - 0.3, y + 0.15) < 0.1;
  };
  const PatchLattice surface = PlaneSeenBy(0, camera, with_islands);
  EXPECT_EQ(CountComponents(Join({surface}, {.min_component_faces = 0, .max_hole_steps = 0})), 3);
  EXPECT_EQ(counts_.components_removed, 0);
  EXPECT_EQ(CountComponents(Join({surface}, {.min_component_faces = 50, .max_hole_steps = 0})), 2);
  EXPECT_EQ(counts_.components_removed, 1);
  EXPECT_EQ(CountComponents(Join({surface}, {.min_component_faces = 200, .max_hole_steps = 0})), 1);
  EXPECT_TRUE(Join({surface}, {.min_component_faces = 1'000'000}).faces.empty());
}

TEST_F(JoinedMeshTest, LoneTrianglesNeverStay) {
  PatchLattice surface = PlaneSeenBy(0, LookAt({0, 0, 1}, {0, 0, 0}, 0), [](double x, double y) {
    return x < 0 || (std::abs(x - 0.3) < 0.02 && std::abs(y) < 0.02);
  });
  int isolated = 0;
  for (int row = 0; row < surface.lattice.rows; ++row) {
    for (int column = 0; column < surface.lattice.columns; ++column) {
      const int64_t node = surface.lattice.Index(column, row);
      if (!surface.HasPatch(node) || surface.Point(column, row).x() < 0.1) continue;
      if (isolated++ == 0) surface.links[static_cast<size_t>(node)] = 0;
      // Normals that make the triangle's outside look like a hole.
      surface.normal_in_world[static_cast<size_t>(node)] = {0, 0, -1};
    }
  }
  ASSERT_EQ(isolated, 4);
  const TriangleMesh mesh = Join({surface}, {.min_component_faces = 0});
  EXPECT_EQ(CountComponents(mesh), 1);
  EXPECT_EQ(counts_.components_removed, 1);
}

TEST_F(JoinedMeshTest, ColorsRunIntoEachOtherAtTheSeam) {
  const TriangleMesh mesh = Join({PlaneSeenBy(
                                      0, left_, [](double x, double) { return x < 0; }, 100),
                                  PlaneSeenBy(
                                      1, right_, [](double x, double) { return x > 0; }, 160)},
                                 {.blend_steps = 6});
  for (size_t v = 0; v < mesh.positions.size(); ++v) {
    const float x = mesh.positions[v].x();
    const int color = mesh.colors[v][1];
    if (std::abs(x) < 0.01) {
      EXPECT_NEAR(color, 130, 2);
    } else if (std::abs(x) > 0.3) {
      EXPECT_EQ(color, x < 0 ? 100 : 160);
    } else {
      EXPECT_GE(color, x < 0 ? 100 : 129);
      EXPECT_LE(color, x < 0 ? 131 : 160);
    }
  }
}

TEST_F(JoinedMeshTest, SimplifiedPartsFitTheSameSeamsAndStayNear) {
  const std::vector<PatchLattice> surfaces = {
      BentToWaves(PlaneSeenBy(0, left_, Everywhere)),
      BentToWaves(PlaneSeenBy(1, right_, [](double x, double y) { return std::hypot(x - 0.5, y) > 0.1; }))};
  const TriangleMesh full = Join(surfaces, {});
  const JoinedMeshCounts full_counts = counts_;
  EXPECT_EQ(full_counts.faces_simplified, 0);
  int64_t fewer = full_counts.faces;
  for (const double g : {0.02, 0.1, 0.5}) {
    const TriangleMesh mesh = Join(surfaces, {.simplify_footprints = g});
    EXPECT_EQ(counts_.faces + counts_.faces_simplified, full_counts.faces);
    EXPECT_EQ(counts_.stitch_faces, full_counts.stitch_faces);
    EXPECT_EQ(counts_.hole_faces, full_counts.hole_faces);
    EXPECT_LT(counts_.faces, fewer);
    fewer = counts_.faces;
    EXPECT_EQ(RimOf(mesh), RimOf(full));
    EXPECT_NEAR(counts_.area, full_counts.area, 0.02 * full_counts.area);
    const MeshRayCaster caster(mesh);
    const double footprint = 1.2 / 80;  // of the farther camera
    double farthest = 0;
    for (const Eigen::Vector3f& x : full.positions) {
      const NearestSurfacePoint nearest = caster.Nearest(x.cast<double>(), 1);
      ASSERT_TRUE(nearest.ok());
      farthest = std::max(farthest, nearest.distance);
    }
    EXPECT_LT(farthest, 3 * g * footprint);
  }
  EXPECT_LT(fewer, full_counts.faces / 2);
}

TEST_F(JoinedMeshTest, HoweverMuchIsLeftOutEdgesAreManifold) {
  for (uint32_t seed = 0; seed < 12; ++seed) {
    const std::vector<PatchLattice> surfaces = RandomParts(seed, 0.6 + 0.03 * seed, 0.97);
    const auto rim = RimOf(Join(surfaces, {.min_component_faces = 0}));
    EXPECT_EQ(RimOf(Join(surfaces, {.min_component_faces = 0, .simplify_footprints = 100})), rim);
    EXPECT_GT(counts_.faces_simplified, 0);
  }
}

TEST_F(JoinedMeshTest, SameBytesForAnyNumberOfThreads) {
  const std::vector<PatchLattice> surfaces = {PlaneSeenBy(0, left_, Everywhere), PlaneSeenBy(1, right_, Everywhere),
                                              RandomSurface(2, SmallCamera(60, 50), 1, 0.9, 0.9)};
  for (const double simplify : {0.0, 0.5}) {
    const JoinOptions options = {.min_component_faces = 0, .simplify_footprints = simplify};
    Join(surfaces, options, 1);
    const std::string bytes = *ReadFile(Path());
    Join(surfaces, options, 4);
    EXPECT_EQ(bytes, *ReadFile(Path()));
  }
}

TEST_F(JoinedMeshTest, BlocksFitEachOther) {
  const auto rim_of_hole = [](double x, double y) { return std::hypot(x, y) > 0.1; };
  const std::vector<PatchLattice> surfaces = {PlaneSeenBy(0, left_, rim_of_hole), PlaneSeenBy(1, right_, rim_of_hole)};
  const TriangleMesh whole = Join(surfaces, {});
  const JoinedMeshCounts counts = counts_;
  for (const int64_t block : {200, 50, 10}) {
    const JoinOptions options = {.vertices_of_block = block};
    const TriangleMesh mesh = Join(surfaces, options);
    EXPECT_EQ(CountComponents(mesh), 1) << block;
    EXPECT_EQ(CountLoops(BorderOf(mesh)), CountLoops(BorderOf(whole))) << block;
    EXPECT_NEAR(static_cast<double>(counts_.stitch_faces), static_cast<double>(counts.stitch_faces),
                0.01 * static_cast<double>(counts.stitch_faces));
    EXPECT_EQ(counts_.holes_filled, counts.holes_filled);
    for (double y = -0.2; y < 0.2; y += 0.0371) {
      for (double x = -0.55; x < 0.5; x += 0.0233) EXPECT_EQ(LayersAt(mesh, x, y), 1) << x << " " << y;
    }
    const std::string bytes = *ReadFile(Path());
    Join(surfaces, options, 3);
    EXPECT_TRUE(*ReadFile(Path()) == bytes) << "it depends on the number of threads";
  }
}

TEST_F(JoinedMeshTest, WhateverTheBlocksEdgesAreManifold) {
  for (uint32_t seed = 0; seed < 12; ++seed) {
    const std::vector<PatchLattice> surfaces = RandomParts(seed, 0.5 + 0.04 * seed, 0.9);
    const JoinOptions options = {.min_component_faces = static_cast<int64_t>(seed % 3) * 5,
                                 .simplify_footprints = seed % 2 == 0 ? 0.0 : 1.0};
    Join(surfaces, options);
    const auto whole = static_cast<double>(counts_.stitch_faces);
    for (const int64_t block : {1000, 100, 1}) {
      JoinOptions in_blocks = options;
      in_blocks.vertices_of_block = block;
      Join(surfaces, in_blocks);
      EXPECT_NEAR(static_cast<double>(counts_.stitch_faces), whole, 0.1 * whole) << block;
    }
  }
}

TEST_F(JoinedMeshTest, NothingAcceptedIsAnEmptyMesh) {
  EXPECT_TRUE(Join({}, {}).positions.empty());
  EXPECT_TRUE(Join({PatchLattice::Empty(0, left_, 2)}, {}).positions.empty());
}

TEST_F(JoinedMeshTest, SurfaceThatCannotBeLoadedLeavesNoFile) {
  ThreadPool pool(1);
  const auto load = [&](int64_t i) -> absl::StatusOr<std::shared_ptr<const SparseSurface>> {
    if (i == 2) return absl::DataLossError("surface 2 is damaged");
    return Sparse(PlaneSeenBy(0, left_, Everywhere));
  };
  EXPECT_EQ(WriteJoinedMesh(3, load, {}, Eigen::Vector3d::Zero(), Path(), pool).status(),
            absl::DataLossError("surface 2 is damaged"));
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST(JoinOptionsTest, RefusesValuesOutOfRange) {
  EXPECT_THAT(JoinOptions{.min_component_faces = -1}.Validate().ToString(), testing::HasSubstr("min_component_faces"));
  EXPECT_THAT(JoinOptions{.close_reach = 1.5}.Validate().ToString(), testing::HasSubstr("close_reach"));
  EXPECT_THAT(JoinOptions{.max_hole_steps = NAN}.Validate().ToString(), testing::HasSubstr("max_hole_steps"));
  EXPECT_THAT(JoinOptions{.blend_steps = -1}.Validate().ToString(), testing::HasSubstr("blend_steps"));
  for (const double g : {-0.1, 100.1, static_cast<double>(NAN)}) {
    EXPECT_THAT(JoinOptions{.simplify_footprints = g}.Validate().ToString(), testing::HasSubstr("simplify_footprints"));
  }
  EXPECT_TRUE(JoinOptions{.simplify_footprints = 100}.Validate().ok());
  EXPECT_THAT(JoinOptions{.vertices_of_block = 0}.Validate().ToString(), testing::HasSubstr("vertices_of_block"));
}

}  // namespace
}  // namespace meshwright
