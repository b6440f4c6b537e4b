// SPDX-License-Identifier: Apache-2.0
#include "worker/visibility/accepted_depth.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/surface/triangulation_testing.h"

namespace meshwright {
namespace {

Camera CameraAt(const Eigen::Vector3d& center, double yaw, int width, int height, double focal) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = focal;
  camera.fy = focal * 1.01;
  camera.cx = 0.49 * width;
  camera.cy = 0.52 * height;
  camera.cam_from_world.rotation = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitY()).toRotationMatrix();
  camera.cam_from_world.translation = -(camera.cam_from_world.rotation * center);
  return camera;
}

AcceptedDepth Visible(const std::vector<PatchLattice>& surfaces, const Camera& reference, int step, ThreadPool& pool) {
  AcceptedDepthBuffer buffer(reference, step);
  for (const PatchLattice& surface : surfaces) buffer.Add(SparseSurface::From(surface), pool);
  return buffer.Depth();
}

// A surface seen by `camera` whose depth is depth(column, row), with nodes missing at random.
template <typename DepthFunction>
PatchLattice MakeSurface(const Camera& camera, int step, double missing, uint32_t seed, const DepthFunction& depth) {
  PatchLattice surface = PatchLattice::Empty(0, camera, step);
  std::mt19937 random(seed);
  const Lattice& lattice = surface.lattice;
  for (int row = 0; row < lattice.rows; ++row) {
    for (int column = 0; column < lattice.columns; ++column) {
      const auto node = static_cast<size_t>(lattice.Index(column, row));
      if (static_cast<double>(random() % 10000) < 10000 * missing) continue;
      surface.depth[node] = static_cast<float>(depth(column, row));
      surface.quality[node] = 0.5F + 0.5F * static_cast<float>(random() % 1000) / 1000.0F;
    }
  }
  for (int row = 0; row < lattice.rows; ++row) {
    for (int column = 0; column < lattice.columns; ++column) {
      const int64_t node = lattice.Index(column, row);
      if (!surface.HasPatch(node)) continue;
      uint8_t& links = surface.links[static_cast<size_t>(node)];
      if (column + 1 < lattice.columns && surface.HasPatch(node + 1)) links |= PatchLattice::kLinkRight;
      if (row + 1 < lattice.rows && surface.HasPatch(node + lattice.columns)) links |= PatchLattice::kLinkDown;
    }
  }
  return surface;
}

PatchLattice Wavy(const Camera& camera, int step, uint32_t seed) {
  return MakeSurface(camera, step, 0.02, seed, [](int column, int row) {
    return 5 + 0.8 * std::sin(0.21 * column) * std::cos(0.17 * row) + (column > 40 ? 1.0 : 0.0);
  });
}

struct Hit {
  double depth = 0;
  double margin = 0;  // the least barycentric coordinate; negative just outside the triangle
};

// Where the ray through a node meets the front of a triangle.
Hit Intersect(const Eigen::Vector3d& ray, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
              const Eigen::Vector3d& c) {
  const Eigen::Vector3d normal = (b - a).cross(c - a);
  const double facing = normal.dot(ray);
  if (facing >= 0) return {0, -1};
  const double depth = normal.dot(a) / facing;
  const Eigen::Vector3d x = depth * ray;
  const double area = normal.squaredNorm();
  const double wa = (b - x).cross(c - x).dot(normal) / area;
  const double wb = (c - x).cross(a - x).dot(normal) / area;
  return {depth, std::min({wa, wb, 1 - wa - wb})};
}

// Holds when `visible` is what intersecting every ray with every triangle gives; rays that pass within a hair of an
// edge may go either way.
void ExpectEqualsSlowTwin(const AcceptedDepth& visible, const PatchLattice& surface, const Camera& reference) {
  const auto triangles = TriangulateLattice(surface);
  ASSERT_FALSE(triangles.empty());
  std::vector<std::array<Eigen::Vector3d, 3>> in_ref;
  for (const auto& triangle : triangles) {
    std::array<Eigen::Vector3d, 3> corners;
    for (size_t k = 0; k < 3; ++k) {
      corners[k] = reference.CamFromWorld(
          surface.Point(triangle[k] % surface.lattice.columns, triangle[k] / surface.lattice.columns));
    }
    if (corners[0].z() > 0 && corners[1].z() > 0 && corners[2].z() > 0) in_ref.push_back(corners);
  }
  int64_t hits = 0;
  for (int row = 0; row < visible.lattice.rows; ++row) {
    for (int column = 0; column < visible.lattice.columns; ++column) {
      const auto node = static_cast<size_t>(visible.lattice.Index(column, row));
      const Eigen::Vector2d pixel = visible.lattice.Pixel(column, row);
      const Eigen::Vector3d ray = reference.RayInCam(pixel.x(), pixel.y());
      double certain = std::numeric_limits<double>::infinity();
      double nearest_to_result = std::numeric_limits<double>::infinity();
      for (const auto& [a, b, c] : in_ref) {
        const Hit hit = Intersect(ray, a, b, c);
        if (hit.margin > 0.02) certain = std::min(certain, hit.depth);
        if (hit.margin > -0.02) {
          nearest_to_result = std::min(nearest_to_result, std::abs(hit.depth - visible.depth[node]));
        }
      }
      if (std::isfinite(certain)) {
        ++hits;
        ASSERT_GT(visible.depth[node], 0) << column << " " << row;
        ASSERT_LE(visible.depth[node], certain * 1.001) << column << " " << row;
      }
      if (visible.depth[node] > 0) {
        ASSERT_LT(nearest_to_result, 5e-3 * visible.depth[node]) << column << " " << row;
        ASSERT_GE(visible.quality[node], 0.5F - 1e-5F);
        ASSERT_LE(visible.quality[node], 1.5F);
      } else {
        ASSERT_EQ(visible.quality[node], 0.0F);
      }
    }
  }
  EXPECT_GT(hits, 200);
}

TEST(AcceptedDepthTest, EqualsIntersectionOfEveryRayWithEveryTriangle) {
  ThreadPool pool(2);
  const Camera source = CameraAt({0, 0, 0}, 0, 120, 80, 100);
  const Camera aside = CameraAt({1.5, 0.2, 0.3}, 0.25, 90, 70, 80);
  const Camera close = CameraAt({0.2, 0.1, 3.0}, -0.1, 60, 50, 60);  // draws each triangle over many rays
  for (const Camera& reference : {aside, close}) {
    for (const int step : {1, 2}) {
      const PatchLattice surface = Wavy(source, 2, 7);
      const AcceptedDepth visible = Visible({surface}, reference, step, pool);
      ExpectEqualsSlowTwin(visible, surface, reference);
    }
  }
}

TEST(AcceptedDepthTest, SeesItsOwnSurfaceAsItIs) {
  ThreadPool pool(1);
  const Camera camera = CameraAt({0.3, -0.2, 0.1}, 0.4, 100, 60, 90);
  const PatchLattice surface =
      MakeSurface(camera, 2, 0, 1, [](int column, int row) { return 4 + 0.01 * column * row; });
  const AcceptedDepth visible = Visible({surface}, camera, 2, pool);
  for (size_t i = 0; i < surface.depth.size(); ++i) {
    EXPECT_NEAR(visible.depth[i], surface.depth[i], 1e-5 * surface.depth[i]);
    EXPECT_NEAR(visible.quality[i], surface.quality[i], 1e-5);
  }
}

TEST(AcceptedDepthTest, AWholeSurfaceHasNoGapsBetweenItsTriangles) {
  ThreadPool pool(2);
  const Camera source = CameraAt({0, 0, 0}, 0, 200, 200, 100);
  const Camera reference = CameraAt({0.4, 0.1, 2.0}, 0.05, 300, 300, 900);  // sees only the middle, in fine detail
  const PatchLattice surface =
      MakeSurface(source, 1, 0, 3, [](int column, int row) { return 5 + 0.05 * ((column * 7 + row * 13) % 11); });
  const AcceptedDepth visible = Visible({surface}, reference, 1, pool);
  EXPECT_THAT(visible.depth, testing::Each(testing::Gt(0.0F)));
}

TEST(AcceptedDepthTest, OrderOfSurfacesAndNumberOfThreadsDoNotMatter) {
  const Camera reference = CameraAt({0.1, 0.3, -0.5}, 0.1, 160, 120, 120);
  std::vector<PatchLattice> surfaces;
  surfaces.reserve(5);
  for (int i = 0; i < 4; ++i) {
    surfaces.push_back(
        Wavy(CameraAt({0.7 * i - 1, 0.1 * i, 0}, 0.1 * i, 160, 120, 120), 1 + i % 3, static_cast<uint32_t>(i)));
  }
  surfaces.push_back(surfaces[1]);  // ties everywhere, but in quality
  for (float& quality : surfaces.back().quality) quality *= 0.9F;

  ThreadPool one(1);
  const AcceptedDepth expected = Visible(surfaces, reference, 1, one);
  ASSERT_GT(std::count_if(expected.depth.begin(), expected.depth.end(), [](float z) { return z > 0; }), 1000);

  ThreadPool three(3);
  std::mt19937 random(5);
  for (int repetition = 0; repetition < 4; ++repetition) {
    std::shuffle(surfaces.begin(), surfaces.end(), random);
    const AcceptedDepth visible = Visible(surfaces, reference, 1, three);
    EXPECT_EQ(visible.depth, expected.depth);
    EXPECT_EQ(visible.quality, expected.quality);
  }
}

TEST(AcceptedDepthTest, BacksOfSurfacesHideNothing) {
  ThreadPool pool(1);
  const Camera source = CameraAt({0, 0, 0}, 0, 100, 100, 100);
  const PatchLattice surface = MakeSurface(source, 1, 0, 1, [](int, int) { return 4.0; });
  const Camera behind = CameraAt({0, 0, 8}, std::acos(-1.0), 100, 100, 100);
  const AcceptedDepth visible = Visible({surface}, behind, 1, pool);
  EXPECT_THAT(visible.depth, testing::Each(0.0F));
}

TEST(AcceptedDepthTest, WhatIsBehindTheCameraOrInNoTriangleIsLeftOut) {
  ThreadPool pool(1);
  const Camera source = CameraAt({0, 0, 0}, 0, 100, 100, 100);
  PatchLattice surface = MakeSurface(source, 1, 0, 1, [](int, int) { return 4.0; });
  const Camera beyond = CameraAt({0, 0, 5}, 0, 100, 100, 100);
  AcceptedDepth visible = Visible({surface}, beyond, 1, pool);
  EXPECT_THAT(visible.depth, testing::Each(0.0F));

  // The camera stands in the plane of the surface.
  const Camera inside = CameraAt({0, 0, 4}, 0.3, 100, 100, 100);
  visible = Visible({surface}, inside, 1, pool);
  for (const float depth : visible.depth) EXPECT_TRUE(std::isfinite(depth));

  std::fill(surface.links.begin(), surface.links.end(), uint8_t{0});
  visible = Visible({surface}, source, 1, pool);
  EXPECT_THAT(visible.depth, testing::Each(0.0F));
}

}  // namespace
}  // namespace meshwright
