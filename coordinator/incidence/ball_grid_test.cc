// SPDX-License-Identifier: Apache-2.0
#include "coordinator/incidence/ball_grid.h"

#include <cmath>
#include <random>
#include <set>
#include <utility>

#include <gtest/gtest.h>

namespace meshwright {
namespace {

using Pairs = std::set<std::pair<CameraIndex, CameraIndex>>;

std::vector<CameraProbes> RandomBalls(int count, double extent, double smallest, double largest) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> place(-extent, extent);
  std::uniform_real_distribution<double> exponent(std::log(smallest), std::log(largest));
  std::vector<CameraProbes> balls(static_cast<size_t>(count));
  for (CameraProbes& ball : balls) {
    ball.frustum_center_in_world = {place(random), place(random), place(random)};
    ball.frustum_radius = std::exp(exponent(random));
  }
  return balls;
}

// The slow twin: all pairs.
Pairs AllMeeting(const std::vector<CameraProbes>& balls) {
  Pairs pairs;
  for (size_t i = 0; i < balls.size(); ++i) {
    for (size_t j = i + 1; j < balls.size(); ++j) {
      if (FrustaMeet(balls[i], balls[j])) pairs.emplace(static_cast<CameraIndex>(i), static_cast<CameraIndex>(j));
    }
  }
  return pairs;
}

// Each pair has to be found once.
Pairs Found(const std::vector<CameraProbes>& balls) {
  const BallGrid grid(balls);
  Pairs pairs;
  std::vector<CameraIndex> meeting;
  for (size_t i = 0; i < balls.size(); ++i) {
    const auto camera = static_cast<CameraIndex>(i);
    grid.FindMeeting(camera, meeting);
    for (const CameraIndex other : meeting) {
      EXPECT_TRUE(pairs.emplace(std::min(camera, other), std::max(camera, other)).second) << camera << ", " << other;
    }
  }
  return pairs;
}

TEST(BallGrid, FindsThePairsThatMeetWhateverTheirSizes) {
  for (const auto& [smallest, largest] : {std::pair(1.0, 1.0), std::pair(0.5, 4.0), std::pair(1e-3, 30.0)}) {
    const std::vector<CameraProbes> balls = RandomBalls(600, 20, smallest, largest);
    const Pairs expected = AllMeeting(balls);
    EXPECT_GT(expected.size(), 50U);
    EXPECT_EQ(Found(balls), expected) << smallest << " to " << largest;
  }
}

TEST(BallGrid, BallsWithoutRadiusAndInOnePlace) {
  std::vector<CameraProbes> balls = RandomBalls(50, 1, 0.1, 1);
  balls.resize(60);  // what cameras without probes have: nothing around the origin
  EXPECT_EQ(Found(balls), AllMeeting(balls));
  EXPECT_EQ(Found(std::vector<CameraProbes>(5)).size(), 10U);
  EXPECT_TRUE(Found({}).empty());
}

TEST(BallGrid, FarFromTheOriginAsWell) {
  std::vector<CameraProbes> balls = RandomBalls(200, 20, 0.5, 4);
  const size_t pairs = Found(balls).size();
  for (CameraProbes& ball : balls) ball.frustum_center_in_world += Eigen::Vector3d(5e5, 4e6, 100);
  EXPECT_EQ(Found(balls), AllMeeting(balls));
  EXPECT_NEAR(static_cast<double>(Found(balls).size()), static_cast<double>(pairs), 2);
}

}  // namespace
}  // namespace meshwright
