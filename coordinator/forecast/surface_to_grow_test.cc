// SPDX-License-Identifier: Apache-2.0
#include "coordinator/forecast/surface_to_grow.h"

#include <algorithm>
#include <vector>

#include <gtest/gtest.h>

#include "coordinator/incidence/feasible_pairs.h"

namespace meshwright {
namespace {

constexpr double kStep = 0.5;  // between the cameras of a street, scene units; they see 2 of it

// Cameras side by side in front of a wall at depth 2.
std::vector<CameraGeometry> Street(int count) {
  std::vector<Camera> cameras;
  for (int i = 0; i < count; ++i) {
    Camera camera = {.width = 640, .height = 480, .fx = 640, .fy = 640, .cx = 320, .cy = 240};
    camera.cam_from_world.translation = {-kStep * i, 0, 0};
    cameras.push_back(camera);
  }
  return CameraGeometries(cameras);
}

struct World {
  explicit World(int count, int k_a = 1)
      : cameras(Street(count)),
        probes(ProbesFromDepths(cameras, std::vector<double>(static_cast<size_t>(count), 2.0))),
        overlaps(FindOverlaps(cameras, probes, IncidenceMatrix(count), {}, pool)),
        model(cameras, probes, overlaps, k_a, pool) {}

  ThreadPool pool{1};
  std::vector<CameraGeometry> cameras;
  std::vector<CameraProbes> probes;
  OverlapGraph overlaps;
  SurfaceToGrow model;
};

TEST(SurfaceToGrowTest, WhoSeesWhatNobodyElseSeesGrowsAllOfIt) {
  World world(1);
  EXPECT_EQ(world.model.ExpectedShare(0), 1);
}

TEST(SurfaceToGrowTest, WhatEnoughCamerasHaveGrownIsNotGrownAgain) {
  for (const int k_a : {1, 2}) {
    World world(20, k_a);
    for (int camera = 0; camera < 19; ++camera) world.model.Commit(camera, true);
    // The last one's neighbours have grown all but the end of the street.
    EXPECT_LT(world.model.ExpectedShare(19), 0.7);
    EXPECT_EQ(world.model.ExpectedShare(19), world.model.ShareNow(19));  // nobody comes before it any more
    World fresh(20, k_a);
    for (int camera = 0; camera < 19; ++camera) fresh.model.Commit(camera, false);
    EXPECT_EQ(fresh.model.ExpectedShare(19), 1);  // nobody else was processed
  }
}

// Shares are of work to come: all of them together, summed as cameras come, are what there is to do, in any order.
TEST(SurfaceToGrowTest, TheSumOfWhatIsExpectedIsWhatIsDone) {
  constexpr int kCameras = 40;
  const auto expected_of = [](const World& world, int from, const std::vector<int>& order) {
    double sum = 0;
    for (size_t i = static_cast<size_t>(from); i < order.size(); ++i) sum += world.model.ExpectedShare(order[i]);
    return sum;
  };
  for (const int stride : {1, 7, 13}) {
    World world(kCameras);
    std::vector<int> order;
    for (int i = 0; i < kCameras; ++i) order.push_back(i * stride % kCameras);
    const double before = expected_of(world, 0, order);
    double done = 0;
    for (int i = 0; i < kCameras; ++i) {
      done += world.model.ShareNow(order[static_cast<size_t>(i)]);
      world.model.Commit(order[static_cast<size_t>(i)], true);
    }
    EXPECT_NEAR(done, before, 0.4 * before) << stride;
    // A street of 40 half-steps is seen 4 times over: two of four grow it.
    EXPECT_LT(before, 0.8 * kCameras);
  }
}

TEST(SurfaceToGrowTest, ItFallsAsSurfaceFills) {
  World world(40);
  double last = 1;
  for (int camera = 0; camera < 39; ++camera) {
    world.model.Commit(camera, true);
    const double share = world.model.ExpectedShare(39);
    EXPECT_LE(share, last + 1e-9);
    last = share;
  }
  EXPECT_LT(last, 0.7);
}

}  // namespace
}  // namespace meshwright
