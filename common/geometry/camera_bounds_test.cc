// SPDX-License-Identifier: Apache-2.0
#include "common/geometry/camera_bounds.h"

#include <cmath>
#include <functional>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace meshwright {
namespace {

Camera Sound() {
  Camera camera{640, 480, 500, 510, 320, 240, {}};
  camera.cam_from_world = {.rotation = Eigen::Matrix3d::Identity(), .translation = {1, 2, 3}};
  return camera;
}

TEST(CheckCamera, SoundCamerasAlsoFarFromZero) {
  EXPECT_TRUE(CheckCamera(Sound()).ok());
  Camera earth = Sound();
  earth.cam_from_world.translation = {4e9, -6.4e9, 1e9};  // mm from the Earth's centre
  EXPECT_TRUE(CheckCamera(earth).ok());
}

TEST(CheckCamera, EveryNumberIsBoundedAndNamed) {
  const struct {
    const char* field;
    std::function<double*(Camera&)> number;
  } cases[] = {{"fx", [](Camera& c) { return &c.fx; }},
               {"fy", [](Camera& c) { return &c.fy; }},
               {"cx", [](Camera& c) { return &c.cx; }},
               {"cy", [](Camera& c) { return &c.cy; }},
               {"R R^T", [](Camera& c) { return &c.cam_from_world.rotation(1, 2); }},
               {"R R^T", [](Camera& c) { return &c.cam_from_world.rotation(0, 0); }},
               {"translation", [](Camera& c) { return &c.cam_from_world.translation[2]; }}};
  for (const auto& tested : cases) {
    for (const double value : {1e300, -1e300, std::numeric_limits<double>::infinity(), std::nan("")}) {
      Camera camera = Sound();
      *tested.number(camera) = value;
      EXPECT_THAT(std::string(CheckCamera(camera).message()), testing::HasSubstr(tested.field)) << value;
    }
  }
  for (double Camera::*const focal : {&Camera::fx, &Camera::fy}) {
    Camera camera = Sound();
    camera.*focal = 0;
    EXPECT_FALSE(CheckCamera(camera).ok());
  }
  for (int Camera::*const side : {&Camera::width, &Camera::height}) {
    for (const int value : {-1, 0, std::numeric_limits<int>::max()}) {
      Camera camera = Sound();
      camera.*side = value;
      EXPECT_FALSE(CheckCamera(camera).ok()) << value;
    }
  }
  Camera mirrored = Sound();
  mirrored.cam_from_world.rotation(0, 0) = -1;
  EXPECT_FALSE(CheckCamera(mirrored).ok());
}

}  // namespace
}  // namespace meshwright
