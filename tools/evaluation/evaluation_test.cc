// SPDX-License-Identifier: Apache-2.0
#include "tools/evaluation/evaluation.h"

#include <cmath>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tools/evaluation/seen_surface.h"

namespace meshwright {
namespace {

using ::testing::AllOf;
using ::testing::Each;
using ::testing::Ge;
using ::testing::HasSubstr;

constexpr double kDepth = 10;
constexpr double kFocal = 100;
constexpr double kFootprint = kDepth / kFocal;

// A square of `columns` x `rows` cells across the optical axes at depth `z`, in front of all cameras.
TriangleMesh Sheet(double left, double right, double top, double bottom, double z, int columns = 40, int rows = 40) {
  TriangleMesh mesh;
  for (int j = 0; j <= rows; ++j) {
    for (int i = 0; i <= columns; ++i) {
      mesh.positions.emplace_back(left + (right - left) * i / columns, top + (bottom - top) * j / rows, z);
    }
  }
  const auto stride = static_cast<uint32_t>(columns + 1);
  for (uint32_t j = 0; j < static_cast<uint32_t>(rows); ++j) {
    for (uint32_t i = 0; i < static_cast<uint32_t>(columns); ++i) {
      const uint32_t a = j * stride + i;
      mesh.faces.push_back({a, a + stride, a + stride + 1});
      mesh.faces.push_back({a, a + stride + 1, a + 1});
    }
  }
  return mesh;
}

TriangleMesh Join(const TriangleMesh& a, const TriangleMesh& b) {
  TriangleMesh mesh = a;
  const auto first = static_cast<uint32_t>(a.positions.size());
  mesh.positions.insert(mesh.positions.end(), b.positions.begin(), b.positions.end());
  for (const auto& face : b.faces) mesh.faces.push_back({face[0] + first, face[1] + first, face[2] + first});
  return mesh;
}

// Four cameras side by side that look along z.
std::vector<Camera> Cameras() {
  std::vector<Camera> cameras;
  for (int i = 0; i < 4; ++i) {
    Camera camera{.width = 120, .height = 90, .fx = kFocal, .fy = kFocal, .cx = 60, .cy = 45};
    camera.cam_from_world.translation = {0.6 - 0.4 * i, 0, 0};
    cameras.push_back(camera);
  }
  return cameras;
}

const TriangleMesh& GroundTruth() {
  static const TriangleMesh mesh = Sheet(-4, 4, -4, 4, kDepth);
  return mesh;
}

EvaluationReport Report(const TriangleMesh& reconstruction, const EvaluationOptions& options = {}) {
  ThreadPool pool(2);
  auto report = Evaluate(reconstruction, GroundTruth(), Cameras(), options, pool);
  EXPECT_TRUE(report.ok()) << report.status();
  return report.value_or(EvaluationReport{});
}

TEST(EvaluationTest, AMeshAgreesWithItself) {
  const EvaluationReport report = Report(GroundTruth());
  EXPECT_THAT(report.recall, Each(1.0));
  EXPECT_THAT(report.precision, Each(1.0));
  EXPECT_THAT(report.f_score, Each(1.0));
  EXPECT_THAT(report.depth, Each(1.0));
  EXPECT_EQ(report.missing, 0);
  EXPECT_NEAR(report.median_accuracy_g, 0, 1e-5);
  EXPECT_NEAR(report.accuracy_90, 0, 1e-6);
  EXPECT_EQ(report.completeness, 1);
  EXPECT_NEAR(report.median_footprint, kFootprint, 1e-6);
  EXPECT_NEAR(report.completeness_distance, 2 * kFootprint, 1e-6);
}

// A plane moved along the axis by c footprints: every depth is off by exactly c g.
TEST(EvaluationTest, DepthStepsWhereTheShiftSays) {
  for (const double c : {0.9, 1.1, 1.9, 2.1, 3.9, 4.1, 7.9, 8.1}) {
    const EvaluationReport report = Report(Sheet(-6, 6, -6, 6, kDepth + c * kFootprint));
    for (size_t k = 0; k < 4; ++k) {
      const double expected = c < EvaluationReport::kThresholds[k] ? 1.0 : 0.0;
      EXPECT_EQ(report.depth[k], expected) << c;
      EXPECT_EQ(report.recall[k], expected) << c;
    }
    if (c < 8) {
      // The reconstruction's own footprint is larger by its greater depth.
      EXPECT_NEAR(report.median_accuracy_g, c / (1 + c / kFocal), 1e-3);
    } else {
      EXPECT_TRUE(report.median_accuracy_g > 7);
    }
  }
}

TEST(EvaluationTest, AccuracyIsTheDistanceThatMostOfTheReconstructionKeeps) {
  EXPECT_NEAR(Report(Sheet(-4, 4, -4, 4, kDepth + 0.3)).accuracy_90, 0.3, 1e-5);
  // 5 % of the area is far away, then 20 %.
  const TriangleMesh far_little = Sheet(-1, 1, -1, 1, kDepth + 5);
  EXPECT_NEAR(Report(Join(GroundTruth(), far_little)).accuracy_90, 0, 1e-5);
  const TriangleMesh far_much = Sheet(-2, 2, -2, 2, kDepth + 5);
  EXPECT_NEAR(Report(Join(GroundTruth(), far_much)).accuracy_90, 5, 1e-5);
}

TEST(EvaluationTest, HalfTheSurfaceHasHalfTheRecallAndFullPrecision) {
  const EvaluationReport report = Report(Sheet(-4, 4, -4, 0, kDepth));
  EXPECT_NEAR(report.recall[0], 0.5, 0.03);
  EXPECT_NEAR(report.depth[3], 0.5, 0.01);
  EXPECT_NEAR(report.missing, 0.5, 0.01);
  EXPECT_NEAR(report.completeness, 0.5, 0.05);
  EXPECT_THAT(report.precision, Each(1.0));
}

TEST(EvaluationTest, AFloatingSheetLowersPrecisionOnly) {
  const EvaluationReport report = Report(Join(GroundTruth(), Sheet(-1, 1, -1, 1, 0.7 * kDepth)));
  EXPECT_THAT(report.recall, Each(1.0));
  EXPECT_THAT(report.precision, Each(AllOf(Ge(0.7), ::testing::Lt(0.95))));
  EXPECT_LT(report.depth[3], 1);
}

TEST(EvaluationTest, WhatHasNoGroundTruthInItsPixelIsNotJudged) {
  const EvaluationReport report = Report(Join(GroundTruth(), Sheet(4.2, 6, -4, 4, 3 + kDepth)));
  EXPECT_THAT(report.precision, Each(1.0));
}

TEST(EvaluationTest, ADenseCloudOfTheGroundTruthHasFullRecall) {
  TriangleMesh cloud = Sheet(-4, 4, -4, 4, kDepth, 400, 400);
  cloud.faces.clear();
  const EvaluationReport report = Report(cloud);
  EXPECT_THAT(report.recall, Each(1.0));
  EXPECT_THAT(report.precision, Each(1.0));
  EXPECT_THAT(report.depth, Each(Ge(0.99)));
  EXPECT_EQ(report.completeness, 1);
  EXPECT_NEAR(report.accuracy_90, 0, 1e-6);
}

TEST(EvaluationTest, RecallAsksOnlyForWhatEnoughCamerasSee) {
  // A board hides a part of the ground truth from all cameras but the leftmost.
  const TriangleMesh board = Sheet(1.2, 3, -4, 4, 5);
  const TriangleMesh truth = Join(GroundTruth(), board);
  ThreadPool pool(1);
  const std::vector<Camera> cameras = Cameras();
  const MeshRayCaster caster(truth);
  const Eigen::Vector3d towards(0, 0, -1);
  for (int i = 0; i < 40; ++i) {
    const Eigen::Vector3d x(0.1 * i + 0.033, 0.05, kDepth);
    int expected = 0;
    for (const Camera& camera : cameras) {
      const double at_board = 0.5 * (x.x() + camera.center_in_world().x());
      const bool in_picture = camera.Contains(camera.ProjectFromCam(camera.CamFromWorld(x)));
      expected += in_picture && (at_board < 1.2 || at_board > 3) ? 1 : 0;
    }
    for (int views = 1; views <= 4; ++views) {
      EXPECT_EQ(IsSeenByEnough(caster, cameras, x, towards, views, 4), expected >= views) << i;
      EXPECT_FALSE(IsSeenByEnough(caster, cameras, x, -towards, views, 4));
    }
  }
  auto all = Evaluate(truth, truth, cameras, {.min_views = 1}, pool);
  auto some = Evaluate(truth, truth, cameras, {.min_views = 4}, pool);
  ASSERT_TRUE(all.ok() && some.ok());
  EXPECT_LT(some->recall_pixels, all->recall_pixels);
  EXPECT_EQ(all->recall_pixels, all->ground_truth_pixels);
}

TEST(EvaluationTest, NothingReconstructedScoresNothing) {
  const EvaluationReport report = Report(TriangleMesh{});
  EXPECT_THAT(report.recall, Each(0.0));
  EXPECT_THAT(report.f_score, Each(0.0));
  EXPECT_EQ(report.missing, 1);
  EXPECT_TRUE(ToJson(report)["accuracy_90"].dump() == "null");
}

TEST(EvaluationTest, SharesGrowWithTheThresholdAndDoNotDependOnThreads) {
  TriangleMesh rough = GroundTruth();
  for (size_t i = 0; i < rough.positions.size(); ++i) {
    rough.positions[i].z() += static_cast<float>(0.3 * std::sin(1.7 * static_cast<double>(i)));
  }
  ThreadPool one(1);
  ThreadPool three(3);
  const auto a = Evaluate(rough, GroundTruth(), Cameras(), {}, one);
  const auto b = Evaluate(rough, GroundTruth(), Cameras(), {}, three);
  ASSERT_TRUE(a.ok() && b.ok());
  EXPECT_EQ(ToJson(*a).dump(), ToJson(*b).dump());
  EXPECT_EQ(ToText(*a), ToText(*b));
  for (const auto& shares : {a->recall, a->precision, a->f_score, a->depth}) {
    EXPECT_TRUE(std::is_sorted(shares.begin(), shares.end()));
    EXPECT_GT(shares.back(), shares.front());
  }
}

TEST(EvaluationTest, SaysWhatIsWrongWithItsInput) {
  ThreadPool pool(1);
  TriangleMesh broken = GroundTruth();
  broken.faces[3][1] = 1u << 30;
  EXPECT_THAT(Evaluate(broken, GroundTruth(), Cameras(), {}, pool).status().ToString(),
              HasSubstr("reconstruction: face 3 names vertex 1073741824"));
  EXPECT_THAT(Evaluate(GroundTruth(), TriangleMesh{}, Cameras(), {}, pool).status().ToString(), HasSubstr("no faces"));
  EXPECT_THAT(Evaluate(GroundTruth(), GroundTruth(), {}, {}, pool).status().ToString(), HasSubstr("camera"));
  EXPECT_THAT(Evaluate(GroundTruth(), Sheet(-1, 1, -1, 1, -5), Cameras(), {}, pool).status().ToString(),
              HasSubstr("no camera sees the ground truth"));
  EXPECT_THAT(Evaluate(GroundTruth(), GroundTruth(), Cameras(), {.pixel_stride = 0}, pool).status().ToString(),
              HasSubstr("pixel_stride is 0"));
}

TEST(SampleSurfaceTest, PointsAreSpreadByArea) {
  const TriangleMesh mesh = Join(Sheet(0, 1, 0, 1, 2, 1, 1), Sheet(5, 8, 0, 1, 2, 7, 3));
  int on_small = 0;
  for (const SurfaceSample& sample : SampleSurface(mesh, 1000)) on_small += sample.x.x() < 3 ? 1 : 0;
  EXPECT_NEAR(on_small, 250, 2);
}

// A sheet of ridges whose two sides are tilted by `degrees` from the plane z.
TriangleMesh Ridges(double degrees, double z) {
  TriangleMesh mesh = Sheet(-12, 12, -9, 9, z, 240, 4);
  const double slope = std::tan(degrees * 3.14159265358979323846 / 180);
  for (Eigen::Vector3f& x : mesh.positions) {
    const int column = static_cast<int>(std::lround((x.x() + 12) * 10));
    if (column % 2 != 0) x.z() += static_cast<float>(0.1 * slope);
  }
  return mesh;
}

TEST(EvaluationTest, NormalsAndRoughnessAreThoseOfTheTriangles) {
  ThreadPool pool(2);
  const TriangleMesh flat = Sheet(-12, 12, -9, 9, kDepth);
  const auto same = Evaluate(flat, flat, Cameras(), {.pixel_stride = 1}, pool);
  ASSERT_TRUE(same.ok()) << same.status();
  EXPECT_NEAR(same->median_normal_error_deg, 0, 1e-3);
  EXPECT_EQ(same->normals_within_10_deg, 1);
  EXPECT_NEAR(same->roughness_deg, 0, 1e-3);
  // Sides of 0.1, as wide as a pixel sees: the normal turns by twice the tilt from side to side.
  const auto rough = Evaluate(Ridges(20, kDepth), flat, Cameras(), {.pixel_stride = 1}, pool);
  ASSERT_TRUE(rough.ok()) << rough.status();
  EXPECT_NEAR(rough->median_normal_error_deg, 20, 0.1);
  EXPECT_EQ(rough->normals_within_10_deg, 0);
  EXPECT_EQ(rough->normals_within_30_deg, 1);
  EXPECT_NEAR(rough->roughness_deg, 40, 2);
  EXPECT_NEAR(rough->ground_truth_roughness_deg, 0, 1e-3);
  // The other way round: the truth is what is rough.
  const auto smooth = Evaluate(flat, Ridges(20, kDepth), Cameras(), {.pixel_stride = 1}, pool);
  ASSERT_TRUE(smooth.ok()) << smooth.status();
  EXPECT_NEAR(smooth->roughness_deg, 0, 1e-3);
  EXPECT_NEAR(smooth->ground_truth_roughness_deg, 40, 2);
}

}  // namespace
}  // namespace meshwright
