// SPDX-License-Identifier: Apache-2.0
#include "common/job/camera_refinement.h"

#include <string>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

namespace meshwright {
namespace {

CameraRefinement Moved() {
  CameraRefinement refinement{
      .tie_points = 400, .error_px_before = 0.5, .error_px_after = 0.1, .off_px = 0.7, .reason = ""};
  for (const double angle : {0.1, 1.7, 3.0}) {
    const Eigen::Vector3d axis = Eigen::Vector3d(1, angle, -2).normalized();
    refinement.cam_from_world.push_back(
        {Eigen::AngleAxisd(angle, axis).toRotationMatrix(), {angle / 3, 1e6 + 1.0 / 3, -1e-17}});
  }
  return refinement;
}

TEST(CameraRefinement, ComesBackToTheLastBit) {
  const CameraRefinement moved = Moved();
  const auto back = DecodeCameraRefinement(EncodeCameraRefinement(moved));
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_EQ(back->tie_points, 400);
  EXPECT_EQ(back->off_px, 0.7);
  ASSERT_EQ(back->cam_from_world.size(), 3);
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(back->cam_from_world[i].rotation, moved.cam_from_world[i].rotation);
    EXPECT_EQ(back->cam_from_world[i].translation, moved.cam_from_world[i].translation);
  }
}

TEST(CameraRefinement, WhatIsNoneIsDataLoss) {
  const std::string good = EncodeCameraRefinement(Moved());
  std::string mirrored = EncodeCameraRefinement({.cam_from_world = {{-Eigen::Matrix3d::Identity(), {0, 0, 1}}}});
  std::string short_pose = R"({"tie_points":1,"error_px_before":0,"error_px_after":0,"off_px":0,"reason":"",)"
                           R"("cam_from_world":[[1,0,0]]})";
  for (const std::string& bad :
       {std::string(), std::string("{}"), good.substr(0, good.size() / 2), mirrored, short_pose}) {
    EXPECT_TRUE(absl::IsDataLoss(DecodeCameraRefinement(bad).status())) << bad.substr(0, 60);
  }
}

TEST(CameraRefinement, GoesToItsOwnScene) {
  Scene scene;
  scene.views.resize(3);
  ASSERT_TRUE(ApplyRefinement(Moved(), scene).ok());
  EXPECT_EQ(scene.views[2].cam_from_world.translation, Moved().cam_from_world[2].translation);
  scene.views.resize(2);
  EXPECT_TRUE(absl::IsFailedPrecondition(ApplyRefinement(Moved(), scene)));
  // Cameras that are best as they are stay so in any scene.
  EXPECT_TRUE(ApplyRefinement({}, scene).ok());
}

}  // namespace
}  // namespace meshwright
