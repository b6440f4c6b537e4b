// SPDX-License-Identifier: Apache-2.0
#include "common/closing/tetrahedra.h"

#include <cmath>
#include <random>
#include <set>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

namespace meshwright {
namespace {

std::vector<Eigen::Vector3d> RandomPoints(int count, uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1, 1);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < count; ++i) points.emplace_back(unit(random), unit(random), unit(random));
  return points;
}

double VolumeOf(const Tetrahedra& tetrahedra, const Tetrahedra::Tetrahedron& t) {
  const auto at = [&](size_t k) { return tetrahedra.points()[static_cast<size_t>(t.corner[k])]; };
  return (at(1) - at(0)).cross(at(2) - at(0)).dot(at(3) - at(0)) / 6;
}

TEST(Tetrahedra, NoPointLiesInTheSphereOfAny) {
  const Tetrahedra tetrahedra(RandomPoints(200, 1));
  ASSERT_GT(tetrahedra.all().size(), 500U);
  for (size_t t = 0; t < tetrahedra.all().size(); ++t) {
    const Tetrahedra::Tetrahedron& of = tetrahedra.all()[t];
    if (VolumeOf(tetrahedra, of) < 1e-9) continue;  // of the hull's rounding
    const Eigen::Vector3d center = tetrahedra.Circumcenter(static_cast<int32_t>(t));
    const double radius = (tetrahedra.points()[static_cast<size_t>(of.corner[0])] - center).norm();
    for (const Eigen::Vector3d& x : tetrahedra.points()) EXPECT_GE((x - center).norm(), radius * (1 - 1e-6));
  }
}

TEST(Tetrahedra, FillTheHullOfACube) {
  std::vector<Eigen::Vector3d> points = RandomPoints(300, 2);
  for (const int i : {0, 1, 2, 3, 4, 5, 6, 7}) {
    points[static_cast<size_t>(i)] = {(i & 1) != 0 ? 1.0 : -1.0, (i & 2) != 0 ? 1.0 : -1.0, (i & 4) != 0 ? 1.0 : -1.0};
  }
  const Tetrahedra tetrahedra(points);
  double volume = 0;
  for (const Tetrahedra::Tetrahedron& t : tetrahedra.all()) {
    EXPECT_GE(VolumeOf(tetrahedra, t), 0);
    volume += VolumeOf(tetrahedra, t);
  }
  EXPECT_NEAR(volume, 8, 1e-6);
}

TEST(Tetrahedra, NeighborsShareTheFaceBetweenThem) {
  const Tetrahedra tetrahedra(RandomPoints(200, 3));
  for (size_t t = 0; t < tetrahedra.all().size(); ++t) {
    for (int face = 0; face < 4; ++face) {
      const int32_t neighbor = tetrahedra.all()[t].neighbor[static_cast<size_t>(face)];
      if (neighbor == Tetrahedra::kNone) continue;
      const auto here = tetrahedra.Face(static_cast<int32_t>(t), face);
      const auto there = tetrahedra.Face(neighbor, tetrahedra.FaceTowards(neighbor, static_cast<int32_t>(t)));
      EXPECT_EQ(std::set<int32_t>(here.begin(), here.end()), std::set<int32_t>(there.begin(), there.end()));
    }
  }
}

TEST(Tetrahedra, WalkGoesStraightThroughNeighborsToTheHull) {
  const Tetrahedra tetrahedra(RandomPoints(500, 4));
  int walks = 0;
  for (int32_t point = 0; point < 100; ++point) {
    const Eigen::Vector3d direction =
        Eigen::Vector3d(std::sin(point), std::cos(point), std::sin(3 * point)).normalized();
    const Eigen::Vector3d& x = tetrahedra.points()[static_cast<size_t>(point)];
    double before = 0;
    int32_t expected = -2;
    int32_t last = -2;
    const int32_t start = tetrahedra.Walk(point, direction, [&](const Tetrahedra::Crossing& crossing) {
      if (expected != -2) {
        EXPECT_EQ(crossing.from, expected);
      }
      EXPECT_GE(crossing.distance, before - 1e-9);
      // The crossing lies within the face: the three triangles that it makes with the corners have the face's area.
      const auto face = tetrahedra.Face(crossing.from, crossing.face);
      const auto at = [&](size_t k) { return tetrahedra.points()[static_cast<size_t>(face[k])]; };
      const Eigen::Vector3d met = x + crossing.distance * direction;
      double parts = 0;
      for (size_t k = 0; k < 3; ++k) parts += (at(k) - met).cross(at((k + 1) % 3) - met).norm();
      EXPECT_NEAR(parts, (at(1) - at(0)).cross(at(2) - at(0)).norm(), 1e-6);
      before = crossing.distance;
      expected = crossing.to;
      last = crossing.to;
      return true;
    });
    if (start == Tetrahedra::kNone) continue;  // a corner of the hull, looking outwards
    ++walks;
    EXPECT_EQ(last, Tetrahedra::kNone) << "the walk ends outside of the hull";
  }
  EXPECT_GT(walks, 80);
}

TEST(Tetrahedra, WalkEndsWhenToldTo) {
  const Tetrahedra tetrahedra(RandomPoints(500, 5));
  int visits = 0;
  tetrahedra.Walk(0, -tetrahedra.points()[0].normalized(), [&](const Tetrahedra::Crossing&) { return ++visits < 3; });
  EXPECT_EQ(visits, 3);
}

TEST(Tetrahedra, PointsInAPlaneOrTooFewHaveNoneOrFlatOnes) {
  EXPECT_TRUE(Tetrahedra({}).all().empty());
  EXPECT_TRUE(Tetrahedra(RandomPoints(4, 6)).all().empty());
  std::vector<Eigen::Vector3d> flat = RandomPoints(50, 7);
  for (Eigen::Vector3d& x : flat) x.z() = 0;
  const Tetrahedra none(flat);
  for (const Tetrahedra::Tetrahedron& t : none.all()) EXPECT_NEAR(VolumeOf(none, t), 0, 1e-9);
  // The same point again and again is no harm.
  const Tetrahedra same(std::vector<Eigen::Vector3d>(20, Eigen::Vector3d(1, 2, 3)));
  EXPECT_LE(same.all().size(), 100U);
}

}  // namespace
}  // namespace meshwright
