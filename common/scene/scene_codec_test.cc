// SPDX-License-Identifier: Apache-2.0
#include "common/scene/scene_codec.h"

#include <cmath>

#include <gtest/gtest.h>

namespace meshwright {
namespace {

Scene SmallScene() {
  Scene scene;
  scene.format = "colmap-text";
  for (int i = 0; i < 3; ++i) {
    SceneView view;
    view.name = std::string("view ") + static_cast<char>('a' + i);
    view.image_path = "somewhere";
    view.lens = {.width = 64, .height = 48, .fx = 100.0 / 3, .fy = std::sqrt(2), .cx = 32, .cy = 24, .skew = 1e-300};
    view.lens.model = Lens::Model::kOpenCv;
    view.lens.coefficients = {0.1, -0.0, 1e-17};
    view.cam_from_world.rotation(0, 1) = 0.1 * i;
    view.cam_from_world.translation = {1.0 / 7, -i, 3};
    scene.views.push_back(view);
  }
  scene.points.push_back({.x_in_world = {0.1, 0.2, 0.3}, .rgb = {1, 2, 255}, .seen_by = {0, 2}});
  scene.points.push_back({});
  scene.offset = {500000, 1.0 / 3, -4e6};
  scene.region = {.center = {1, 2, 3}, .axes = Eigen::Matrix3d::Identity(), .size = {4, 5, 1.0 / 6}};
  scene.views[1].mask_path = "mask";
  return scene;
}

TEST(SceneCodecTest, EveryValueComesBack) {
  const Scene scene = SmallScene();
  const std::string bytes = EncodeScene(scene);
  const auto decoded = DecodeScene(bytes);
  ASSERT_TRUE(decoded.ok()) << decoded.status();
  EXPECT_TRUE(EncodeScene(*decoded) == bytes);
  ASSERT_EQ(decoded->views.size(), 3);
  EXPECT_EQ(decoded->views[2].name, "view c");
  EXPECT_EQ(decoded->views[2].lens.fx, 100.0 / 3);
  EXPECT_EQ(decoded->views[2].lens.coefficients, scene.views[2].lens.coefficients);
  EXPECT_EQ(decoded->views[2].cam_from_world.rotation, scene.views[2].cam_from_world.rotation);
  EXPECT_EQ(decoded->points[0].seen_by, scene.points[0].seen_by);
  EXPECT_EQ(decoded->points[0].x_in_world, scene.points[0].x_in_world);
  EXPECT_EQ(decoded->offset, scene.offset);
  EXPECT_EQ(decoded->region->size, scene.region->size);
  EXPECT_EQ(decoded->views[1].mask_path, "mask");
}

TEST(SceneCodecTest, TruncatedOrFlippedBytesAreRefused) {
  const std::string bytes = EncodeScene(SmallScene());
  for (size_t size = 0; size < bytes.size(); size += 7) EXPECT_FALSE(DecodeScene(bytes.substr(0, size)).ok());
  for (size_t i = 0; i < bytes.size(); i += 3) {
    std::string damaged = bytes;
    damaged[i] = static_cast<char>(damaged[i] ^ 0x10);
    EXPECT_FALSE(DecodeScene(damaged).ok()) << i;
  }
}

}  // namespace
}  // namespace meshwright
