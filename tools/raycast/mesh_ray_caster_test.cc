// SPDX-License-Identifier: Apache-2.0
#include "tools/raycast/mesh_ray_caster.h"

#include <cmath>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tools/raycast/depth_map.h"

namespace meshwright {
namespace {

using ::testing::Each;

// The slow twin casts every ray against every triangle (Moeller and Trumbore 1997).
double SlowCast(const TriangleMesh& mesh, const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) {
  double nearest = MeshRayCaster::kInfinity;
  for (const auto& face : mesh.faces) {
    const Eigen::Vector3d a = mesh.positions[face[0]].cast<double>();
    const Eigen::Vector3d ab = mesh.positions[face[1]].cast<double>() - a;
    const Eigen::Vector3d ac = mesh.positions[face[2]].cast<double>() - a;
    const Eigen::Vector3d p = direction.cross(ac);
    const double determinant = ab.dot(p);
    const double u = (origin - a).dot(p) / determinant;
    const Eigen::Vector3d q = (origin - a).cross(ab);
    const double v = direction.dot(q) / determinant;
    const double t = ac.dot(q) / determinant;
    if (u >= 0 && v >= 0 && u + v <= 1 && t > 0) nearest = std::min(nearest, t);
  }
  return nearest;
}

// Nearest over a fine sampling of every triangle: an upper bound that is tight to the sampling distance.
double SampledNearest(const TriangleMesh& mesh, const Eigen::Vector3d& x) {
  constexpr int kSteps = 60;
  double nearest = MeshRayCaster::kInfinity;
  for (const auto& face : mesh.faces) {
    const Eigen::Vector3d a = mesh.positions[face[0]].cast<double>();
    const Eigen::Vector3d b = mesh.positions[face[1]].cast<double>();
    const Eigen::Vector3d c = mesh.positions[face[2]].cast<double>();
    for (int i = 0; i <= kSteps; ++i) {
      for (int j = 0; i + j <= kSteps; ++j) {
        const Eigen::Vector3d sample = (a * (kSteps - i - j) + b * i + c * j) / kSteps;
        nearest = std::min(nearest, (sample - x).norm());
      }
    }
  }
  return nearest;
}

TriangleMesh RandomTriangles(int count) {
  uint32_t state = 1;
  const auto next = [&state] {
    state = state * 1664525U + 1013904223U;
    return static_cast<float>(state >> 8U) / 16777216.0F;
  };
  TriangleMesh mesh;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3f center(2 * next() - 1, 2 * next() - 1, 2 * next() - 1);
    for (int j = 0; j < 3; ++j) {
      const Eigen::Vector3f offset(next() - 0.5F, next() - 0.5F, next() - 0.5F);
      mesh.positions.emplace_back(center + 0.6F * offset);
    }
    const auto first = static_cast<uint32_t>(3 * i);
    mesh.faces.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

TEST(MeshRayCasterTest, AgreesWithCastingAgainstEveryTriangle) {
  const TriangleMesh mesh = RandomTriangles(60);
  const MeshRayCaster caster(mesh);
  const Eigen::Vector3d origin(0.1, -0.2, -4);
  int hits = 0;
  for (int i = 0; i < 400; ++i) {
    const int row = i / 20;
    const Eigen::Vector3d direction(0.03 * (i % 20) - 0.3, 0.03 * row - 0.3, 1);
    const double expected = SlowCast(mesh, origin, direction);
    const RayHit hit = caster.Cast(origin, direction);
    const RayHit in_packet = caster.Cast4(origin, {direction, direction, direction, direction})[2];
    ASSERT_EQ(hit.ok(), std::isfinite(expected));
    EXPECT_EQ(in_packet.ok(), hit.ok());
    EXPECT_EQ(caster.IsBlocked(origin, direction, 0, 100), hit.ok());
    if (!hit.ok()) continue;
    ++hits;
    EXPECT_NEAR(hit.distance, expected, 1e-9);
    EXPECT_EQ(in_packet.distance, hit.distance);
    EXPECT_FALSE(caster.IsBlocked(origin, direction, 0, 0.999 * expected));
  }
  EXPECT_GT(hits, 50);
}

TEST(MeshRayCasterTest, BlockedFourAtOnceAgreesWithOneByOne) {
  const MeshRayCaster caster(RandomTriangles(60));
  const Eigen::Vector3d direction(0.2, 0.1, 1);
  for (int i = 0; i < 50; ++i) {
    std::array<Eigen::Vector3d, 4> origins;
    uint32_t expected = 0;
    for (size_t j = 0; j < 4; ++j) {
      origins[j] = Eigen::Vector3d(0.04 * i - 1, 0.5 * static_cast<double>(j) - 1, -2);
      if (caster.IsBlocked(origins[j], direction, 0.5, MeshRayCaster::kInfinity)) expected |= 1U << j;
    }
    EXPECT_EQ(caster.AreBlocked4(origins, direction, 0.5, 0xF), expected);
    EXPECT_EQ(caster.AreBlocked4(origins, direction, 0.5, 0x5), expected & 0x5U);
  }
}

TEST(MeshRayCasterTest, NearestAgreesWithSampledTriangles) {
  const TriangleMesh mesh = RandomTriangles(20);
  const MeshRayCaster caster(mesh);
  for (int i = 0; i < 60; ++i) {
    const int row = i / 5 % 4;
    const int layer = i / 20;
    const Eigen::Vector3d x(0.4 * (i % 5) - 1, 0.4 * row - 1, 0.8 * layer - 1);
    const double expected = SampledNearest(mesh, x);
    const NearestSurfacePoint nearest = caster.Nearest(x, MeshRayCaster::kInfinity);
    ASSERT_TRUE(nearest.ok());
    EXPECT_LE(nearest.distance, expected + 1e-6);
    EXPECT_GE(nearest.distance, expected - 0.02);
    EXPECT_TRUE(caster.Nearest(x, 1.001 * nearest.distance).ok());
    EXPECT_FALSE(caster.Nearest(x, 0.999 * nearest.distance).ok());
  }
}

TEST(MeshRayCasterTest, NothingMeetsAMeshWithoutFaces) {
  const MeshRayCaster caster(TriangleMesh{});
  EXPECT_FALSE(caster.Cast(Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitZ()).ok());
  EXPECT_FALSE(caster.Nearest(Eigen::Vector3d::Zero(), 1).ok());
}

TEST(RenderDepthTest, APlaneAcrossTheAxisHasOneDepthEverywhere) {
  TriangleMesh mesh;
  mesh.positions = {{-50, -50, 7}, {50, -50, 7}, {50, 50, 7}, {-50, 50, 7}};
  mesh.faces = {{0, 1, 2}, {0, 2, 3}};
  Camera camera{.width = 37, .height = 21, .fx = 30, .fy = 30, .cx = 18.5, .cy = 10.5};
  ThreadPool pool(2);
  const DepthMap map = RenderDepth(MeshRayCaster(mesh), camera, 2, pool);
  EXPECT_EQ(map.lattice.columns, 18);
  EXPECT_THAT(map.depth, Each(7.0F));
  EXPECT_THAT(map.normal_in_world, Each(Eigen::Vector3f(0, 0, -1)));
}

}  // namespace
}  // namespace meshwright
