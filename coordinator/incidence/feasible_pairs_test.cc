// SPDX-License-Identifier: Apache-2.0
#include "coordinator/incidence/feasible_pairs.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "coordinator/incidence/cameras_testing.h"

namespace meshwright {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr double kRadians = std::numbers::pi / 180;

// `count` cameras on a circle of radius 5 about the origin, `step_deg` apart, looking at it.
std::vector<Camera> Ring(int count, double step_deg) {
  std::vector<Camera> cameras;
  for (int i = 0; i < count; ++i) {
    const double angle = i * step_deg * kRadians;
    cameras.push_back(CameraLookingAt({5 * std::cos(angle), 5 * std::sin(angle), 0}, {0, 0, 0}));
  }
  return cameras;
}

// Points around the origin; a camera sees all that project into it.
std::vector<SparsePoint> PointsSeenBy(const std::vector<Camera>& cameras, int count, double extent) {
  std::mt19937 generator(1);
  std::uniform_real_distribution<double> uniform(-extent, extent);
  std::vector<SparsePoint> points;
  for (int i = 0; i < count; ++i) {
    SparsePoint point;
    point.x_in_world = {uniform(generator), uniform(generator), uniform(generator)};
    for (size_t camera = 0; camera < cameras.size(); ++camera) {
      if (CameraGeometry(cameras[camera]).Sees(point.x_in_world)) {
        point.seen_by.push_back(static_cast<CameraIndex>(camera));
      }
    }
    points.push_back(point);
  }
  return points;
}

int64_t Sum(const FeasiblePairCounts& counts) {
  return counts.feasible + counts.few_points + counts.parallel_axes + counts.behind_camera + counts.outside_image +
         counts.angle_too_small + counts.angle_too_large + counts.scale_differs + counts.outside_depths;
}

TEST(FeasiblePairs, OnARingTheAngleDecides) {
  ThreadPool pool(1);
  const std::vector<Camera> cameras = Ring(90, 4);
  const std::vector<SparsePoint> points = PointsSeenBy(cameras, 50, 0.01);
  for (const bool with_points : {false, true}) {
    const absl::StatusOr<FeasiblePairs> pairs =
        FindFeasiblePairs(cameras, with_points ? points : std::vector<SparsePoint>(), {}, pool);
    ASSERT_TRUE(pairs.ok()) << pairs.status();
    EXPECT_EQ(Sum(pairs->counts), 90 * 89 / 2);
    EXPECT_EQ(pairs->counts.cameras_without_pair, 0);
    for (CameraIndex i = 0; i < 90; ++i) {
      for (CameraIndex j = 0; j < 90; ++j) {
        const int steps = std::min((i - j + 90) % 90, (j - i + 90) % 90);
        EXPECT_EQ(pairs->matrix.Get(i, j), steps >= 1 && steps <= 12) << i << ' ' << j;
      }
    }
  }
}

TEST(FeasiblePairs, TenCommonPointsAreNeeded) {
  ThreadPool pool(1);
  const std::vector<Camera> cameras = Ring(3, 15);
  std::vector<SparsePoint> points = PointsSeenBy(cameras, 10, 0.1);
  points[0].seen_by = {0, 1};
  const absl::StatusOr<FeasiblePairs> pairs = FindFeasiblePairs(cameras, points, {}, pool);
  ASSERT_TRUE(pairs.ok()) << pairs.status();
  EXPECT_THAT(pairs->matrix.Neighbours(0), ElementsAre(1));
  EXPECT_THAT(pairs->matrix.Neighbours(2), IsEmpty());
  EXPECT_EQ(pairs->counts.few_points, 2);
  EXPECT_EQ(pairs->counts.cameras_without_pair, 1);
}

TEST(FeasiblePairs, ScaleDecides) {
  ThreadPool pool(1);
  std::vector<Camera> cameras = Ring(2, 20);
  for (const double closer : {0.95, 0.85, 0.75}) {
    cameras[1] = CameraLookingAt(closer * Eigen::Vector3d(5 * std::cos(0.35), 5 * std::sin(0.35), 0), {0, 0, 0});
    const std::vector<SparsePoint> points = PointsSeenBy(cameras, 30, 0.01);
    for (const bool with_points : {false, true}) {
      const absl::StatusOr<FeasiblePairs> pairs =
          FindFeasiblePairs(cameras, with_points ? points : std::vector<SparsePoint>(), {}, pool);
      EXPECT_EQ(pairs.ok(), closer > 0.8);
      if (!pairs.ok()) {
        EXPECT_THAT(pairs.status().ToString(), HasSubstr("1 differ in scale"));
      }
    }
  }
}

TEST(FeasiblePairs, SizeOfASmallBallIsItsMajorAxis) {
  const std::vector<Camera> cameras = {CameraLookingAt({0, 0, 0}, {0, 1, 0}), CameraLookingAt({3, 1, 2}, {1, 4, 1})};
  const Eigen::Vector3d x(1.1, 3, 0.7);
  double size[2];
  for (int i = 0; i < 2; ++i) {
    // Extent of the projections of a small sphere's points, measured in the direction in which it is largest.
    const Camera& camera = cameras[static_cast<size_t>(i)];
    const Eigen::Vector2d middle = camera.ProjectFromCam(camera.CamFromWorld(x));
    size[i] = 0;
    for (int u = 0; u < 180; ++u) {
      for (int v = 0; v < 360; ++v) {
        const Eigen::Vector3d on_ball =
            1e-4 * Eigen::Vector3d(std::sin(u * kRadians) * std::cos(v * kRadians),
                                   std::sin(u * kRadians) * std::sin(v * kRadians), std::cos(u * kRadians));
        size[i] = std::max(size[i], (camera.ProjectFromCam(camera.CamFromWorld(x + on_ball)) - middle).norm());
      }
    }
  }
  EXPECT_NEAR(ScaleRatio(CameraGeometry(cameras[0]), CameraGeometry(cameras[1]), x),
              std::min(size[0], size[1]) / std::max(size[0], size[1]), 1e-3);
}

TEST(FeasiblePairs, NothingFeasibleIsSaidWithCounts) {
  ThreadPool pool(1);
  std::vector<Camera> parallel;
  parallel.reserve(4);
  for (int i = 0; i < 4; ++i) parallel.push_back(CameraLookingAt({1.0 * i, 0, 0}, {1.0 * i, 1, 0}));
  const absl::Status by_axes = FindFeasiblePairs(parallel, {}, {}, pool).status();
  EXPECT_EQ(by_axes.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(by_axes.ToString(), HasSubstr("6 belong to parallel axes"));
  EXPECT_THAT(by_axes.ToString(), HasSubstr("sparse points"));

  SparsePoint point;
  point.seen_by = {0, 1};
  const absl::Status by_points = FindFeasiblePairs(parallel, {point}, {}, pool).status();
  EXPECT_EQ(by_points.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(by_points.ToString(), HasSubstr("6 pairs share fewer than min_common_points = 10"));

  EXPECT_EQ(FindFeasiblePairs({}, {}, {}, pool).status().code(), absl::StatusCode::kFailedPrecondition);
}

TEST(FeasiblePairs, NeighboursThatLookInParallelSeeACommonPart) {
  ThreadPool pool(1);
  // Two cameras that look at a wall at y = 10 and meet on it; a third beside them that looks in parallel to the first.
  const std::vector<Camera> cameras = {CameraLookingAt({0, 0, 0}, {0, 10, 0}), CameraLookingAt({2, 0, 0}, {0, 10, 0}),
                                       CameraLookingAt({-2, 0, 0}, {-2, 10, 0})};
  const absl::StatusOr<FeasiblePairs> pairs = FindFeasiblePairs(cameras, {}, {}, pool);
  ASSERT_TRUE(pairs.ok()) << pairs.status();
  EXPECT_TRUE(pairs->matrix.Get(0, 2)) << "although their axes meet nowhere";
  EXPECT_GT(pairs->counts.by_common_view, 0);
}

// A walk around a room that looks outwards: each camera with the ones beside it, none with those that see another wall.
TEST(FeasiblePairs, AWalkThroughARoomPairsNeighbours) {
  ThreadPool pool(2);
  std::vector<Camera> cameras;
  constexpr int kCameras = 40;
  for (int i = 0; i < kCameras; ++i) {
    const double angle = 2 * std::numbers::pi * i / kCameras;
    const double yaw = angle + (i % 2 == 0 ? 0.2 : -0.2);
    const Eigen::Vector3d center(2 * std::cos(angle), 2 * std::sin(angle), 0);
    cameras.push_back(CameraLookingAt(center, center + Eigen::Vector3d(std::cos(yaw), std::sin(yaw), 0)));
  }
  const absl::StatusOr<FeasiblePairs> pairs = FindFeasiblePairs(cameras, {}, {}, pool);
  ASSERT_TRUE(pairs.ok()) << pairs.status();
  EXPECT_EQ(Sum(pairs->counts), kCameras * (kCameras - 1) / 2);
  for (CameraIndex i = 0; i < kCameras; ++i) {
    EXPECT_TRUE(pairs->matrix.Get(i, (i + 2) % kCameras)) << i << ": they look in nearly the same direction";
    for (const CameraIndex j : pairs->matrix.Neighbours(i)) {
      EXPECT_LE(std::min((i - j + kCameras) % kCameras, (j - i + kCameras) % kCameras), kCameras / 4);
    }
  }
}

TEST(FeasiblePairs, AxesThatMeetAtTheHorizonDoNotCount) {
  ThreadPool pool(2);
  // A street: every metre a camera, in turn to the left, ahead and to the right of the direction to the facade. Two of
  // them that are 100 m apart meet far behind it.
  std::vector<Camera> cameras;
  cameras.reserve(200);
  for (int i = 0; i < 200; ++i) cameras.push_back(CameraLookingAt({1.0 * i, 0, 0}, {1.0 * i + (i % 3 - 1) * 4, 10, 0}));
  const absl::StatusOr<FeasiblePairs> pairs = FindFeasiblePairs(cameras, {}, {}, pool);
  ASSERT_TRUE(pairs.ok()) << pairs.status();
  EXPECT_EQ(Sum(pairs->counts), 200 * 199 / 2);
  EXPECT_GT(pairs->counts.outside_depths, 0);
  EXPECT_EQ(pairs->counts.cameras_without_pair, 0);
  for (CameraIndex i = 0; i < 200; ++i) {
    for (const CameraIndex j : pairs->matrix.Neighbours(i)) EXPECT_LT(std::abs(i - j), 60);
  }
}

TEST(FeasiblePairs, TwoCamerasKnowTheirDepth) {
  ThreadPool pool(1);
  const absl::StatusOr<FeasiblePairs> pairs = FindFeasiblePairs(Ring(2, 15), {}, {}, pool);
  ASSERT_TRUE(pairs.ok()) << pairs.status();
  for (const CameraProbes& probes : pairs->probes) {
    EXPECT_FALSE(probes.in_world.empty());
    EXPECT_LT(probes.near_depth, 5);
    EXPECT_GT(probes.far_depth, 5);
  }
}

TEST(FeasiblePairs, ThreadsDoNotMatter) {
  ThreadPool one(1);
  ThreadPool three(3);
  const std::vector<Camera> cameras = Ring(60, 6);
  const std::vector<SparsePoint> points = PointsSeenBy(cameras, 100, 0.5);
  for (const auto& known : {points, std::vector<SparsePoint>()}) {
    EXPECT_EQ(FindFeasiblePairs(cameras, known, {}, one)->matrix, FindFeasiblePairs(cameras, known, {}, three)->matrix);
  }
}

TEST(FeasiblePairs, OptionsNameWhatIsWrong) {
  EXPECT_TRUE(FeasiblePairOptions().Validate().ok());
  EXPECT_THAT(FeasiblePairOptions{.min_common_points = 0}.Validate().ToString(),
              HasSubstr("min_common_points is 0, expected >= 1"));
  EXPECT_FALSE(FeasiblePairOptions{.min_angle_deg = 60}.Validate().ok());
  EXPECT_FALSE(FeasiblePairOptions{.min_scale_ratio = 1.5}.Validate().ok());
  EXPECT_FALSE(FeasiblePairOptions{.min_common_view = 0}.Validate().ok());
}

}  // namespace
}  // namespace meshwright
