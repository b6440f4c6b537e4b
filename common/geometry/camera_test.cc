// SPDX-License-Identifier: Apache-2.0
#include "common/geometry/camera.h"

#include <random>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "common/geometry/level_of_detail.h"

namespace meshwright {
namespace {

Camera RandomCamera(std::mt19937& generator) {
  std::uniform_real_distribution<double> uniform(-1, 1);
  Camera camera{.width = 640, .height = 480, .fx = 500, .fy = 510, .cx = 322, .cy = 238};
  camera.cam_from_world.rotation =
      Eigen::Quaterniond(uniform(generator), uniform(generator), uniform(generator), uniform(generator))
          .normalized()
          .toRotationMatrix();
  camera.cam_from_world.translation = {uniform(generator), uniform(generator), uniform(generator)};
  return camera;
}

TEST(Camera, ProjectionUndoesBackProjection) {
  std::mt19937 generator(1);
  std::uniform_real_distribution<double> uniform(0, 1);
  for (int i = 0; i < 100; ++i) {
    const Camera camera = RandomCamera(generator);
    const Eigen::Vector2d pixel(640 * uniform(generator), 480 * uniform(generator));
    const double depth = 0.1 + 10 * uniform(generator);
    const Eigen::Vector3d x_in_cam = camera.CamFromWorld(camera.BackProject(pixel.x(), pixel.y(), depth));
    EXPECT_NEAR(x_in_cam.z(), depth, 1e-9);
    EXPECT_LT((camera.ProjectFromCam(x_in_cam) - pixel).norm(), 1e-8);
  }
}

TEST(Camera, CenterProjectsToTheOrigin) {
  std::mt19937 generator(2);
  const Camera camera = RandomCamera(generator);
  EXPECT_LT(camera.CamFromWorld(camera.center_in_world()).norm(), 1e-12);
}

TEST(Rigid3, InverseAndComposition) {
  std::mt19937 generator(3);
  const Rigid3 b_from_a = RandomCamera(generator).cam_from_world;
  const Rigid3 c_from_b = RandomCamera(generator).cam_from_world;
  const Eigen::Vector3d x(1, 2, 3);
  EXPECT_LT((Inverse(b_from_a) * (b_from_a * x) - x).norm(), 1e-12);
  EXPECT_LT(((c_from_b * b_from_a) * x - c_from_b * (b_from_a * x)).norm(), 1e-12);
}

TEST(LevelOfDetail, ProjectsToTheLatticeStep) {
  std::mt19937 generator(4);
  Camera camera = RandomCamera(generator);
  camera.fy = camera.fx;
  const double depth = 7;
  const double radius = LevelOfDetail(camera, depth, 2);
  const Eigen::Vector2d a = camera.ProjectFromCam({0, 0, depth});
  const Eigen::Vector2d b = camera.ProjectFromCam({radius, 0, depth});
  EXPECT_NEAR((a - b).norm(), 2, 1e-9);
}

}  // namespace
}  // namespace meshwright
