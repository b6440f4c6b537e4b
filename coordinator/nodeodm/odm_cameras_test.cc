// SPDX-License-Identifier: Apache-2.0
#include "coordinator/nodeodm/odm_cameras.h"

#include <cmath>

#include <gtest/gtest.h>

namespace meshwright {
namespace {

SceneView View(const std::string& name, double k1) {
  SceneView view;
  view.name = name;
  view.lens = {.width = 400, .height = 300, .fx = 500, .fy = 510, .cx = 201, .cy = 148, .model = Lens::Model::kOpenCv};
  view.lens.coefficients = {k1, 0.2, 0.01, -0.02};
  // A quarter turn around z, from (1, 2, 3).
  view.cam_from_world.rotation << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  view.cam_from_world.translation = -(view.cam_from_world.rotation * Eigen::Vector3d(1, 2, 3));
  return view;
}

TEST(OdmCamerasTest, AreNormalisedAndToldOnce) {
  const Scene scene = {.views = {View("a.jpg", 0.1), View("b.jpg", 0.1), View("c.jpg", 0.3)}};
  const auto cameras = OdmCameras(scene);
  ASSERT_EQ(cameras.size(), 2U);
  const auto& first = cameras.begin().value();
  EXPECT_EQ(first["projection_type"], "brown");
  EXPECT_DOUBLE_EQ(first["focal_x"], 500.0 / 400);
  EXPECT_DOUBLE_EQ(first["focal_y"], 510.0 / 400);
  EXPECT_DOUBLE_EQ(first["c_x"], 1.0 / 400);
  EXPECT_DOUBLE_EQ(first["c_y"], -2.0 / 400);
  EXPECT_EQ(first["k1"], 0.1);
  EXPECT_EQ(first["p2"], -0.02);
  EXPECT_EQ(first["k3"], 0.0);
  const auto shots = OdmShots(scene)["features"];
  ASSERT_EQ(shots.size(), 3U);
  for (const auto& shot : shots) EXPECT_TRUE(cameras.contains(shot["properties"]["camera"].get<std::string>())) << shot;
  EXPECT_EQ(OdmImages(scene)[2]["filename"], "c.jpg");
}

TEST(OdmCamerasTest, ShotsSayWhereTheCameraIsAndInventNoPlace) {
  const auto shot = OdmShots({.views = {View("a.jpg", 0)}})["features"][0];
  EXPECT_TRUE(shot["geometry"].is_null());
  const double place[] = {1, 2, 3};
  const double turn[] = {0, 0, std::acos(-1.0) / 2};
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(shot["properties"]["translation"][i].get<double>(), place[i], 1e-12);
    EXPECT_NEAR(shot["properties"]["rotation"][i].get<double>(), turn[i], 1e-12);
  }
}

}  // namespace
}  // namespace meshwright
