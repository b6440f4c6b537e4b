// SPDX-License-Identifier: Apache-2.0
#include <cstdlib>
#include <map>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "common/base/clock.h"
#include "common/base/files.h"
#include "common/scene/formats/assemble.h"
#include "common/scene/formats/import.h"
#include "common/scene/formats/text_fields.h"
#include "common/scene/view.h"

namespace meshwright {
namespace {

// Folder of the real scenes; tests run in the root of the repository.
std::string DataFolder() {
  const char* folder = std::getenv("MESHWRIGHT_TEST_DATA");
  return folder != nullptr ? folder : "../shared/data";
}

class RealScenes : public testing::Test {
 protected:
  void SetUp() override {
    if (!IsFolder(DataFolder())) GTEST_SKIP() << "no real scenes at " << DataFolder();
  }

  Scene Import(const std::string& name) {
    const absl::StatusOr<Scene> scene = ImportScene(JoinPath(DataFolder(), name));
    EXPECT_TRUE(scene.ok()) << scene.status();
    return scene.ok() ? *scene : Scene();
  }
};

TEST_F(RealScenes, HaveTheirCameras) {
  const std::pair<const char*, size_t> sets[] = {{"templeSparseRing", 16}, {"templeRing", 47},
                                                 {"temple", 312},          {"fountain-P11", 11},
                                                 {"castle-P30", 30},       {"herzjesu-rendered", 8}};
  for (const auto& [name, count] : sets) EXPECT_EQ(Import(name).views.size(), count) << name;
}

TEST_F(RealScenes, MiddleburyCamerasSeeTheTemplesBox) {
  for (const SceneView& view : Import("temple").views) {
    const Camera camera = UndistortedCamera(view, 0);
    EXPECT_EQ(camera.width, 640);
    // The tight bounding box that the set's README gives.
    for (const double x : {-0.054568, 0.047855}) {
      for (const double y : {0.001728, 0.161892}) {
        for (const double z : {-0.042945, 0.032236}) {
          const Eigen::Vector3d x_in_cam = camera.CamFromWorld({x, y, z});
          EXPECT_GT(x_in_cam.z(), 0) << view.name;
          EXPECT_TRUE(camera.Contains(camera.ProjectFromCam(x_in_cam), -20)) << view.name;
        }
      }
    }
  }
}

// Least-squares meeting point of the optical axes.
Eigen::Vector3d MeetingPoint(const Scene& scene) {
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (const SceneView& view : scene.views) {
    const Camera camera = UndistortedCamera(view, 0);
    const Eigen::Vector3d axis = camera.viewing_direction_in_world();
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - axis * axis.transpose();
    a += across;
    b += across * camera.center_in_world();
  }
  return a.ldlt().solve(b);
}

TEST_F(RealScenes, StrechaCamerasLookAtTheFountain) {
  const Scene scene = Import("fountain-P11");
  const Eigen::Vector3d target = MeetingPoint(scene);
  for (const SceneView& view : scene.views) {
    const Camera camera = UndistortedCamera(view, 1536);
    EXPECT_EQ(camera.width, 1536);
    EXPECT_EQ(camera.height, 1024);
    const Eigen::Vector3d x_in_cam = camera.CamFromWorld(target);
    EXPECT_GT(x_in_cam.z(), 1) << view.name;
    EXPECT_TRUE(camera.Contains(camera.ProjectFromCam(x_in_cam))) << view.name;
  }
}

// The points of an image's second line by their number, read again without the importer.
std::map<std::pair<int64_t, int64_t>, Eigen::Vector2d> ReadObservations(const std::string& images_file,
                                                                        std::map<int64_t, std::string>* names) {
  std::map<std::pair<int64_t, int64_t>, Eigen::Vector2d> observations;
  const std::string text = ReadFile(images_file).value();
  TextLines lines(text);
  std::string_view line;
  while (lines.NextContent(&line)) {
    TextFields image(line, {images_file, "line", lines.number()});
    const int64_t id = image.Integer("id", 0, 1000).value();
    for (int i = 0; i < 8; ++i) EXPECT_TRUE(image.Number("pose").ok());
    (*names)[id] = std::string(image.Rest("name").value());
    EXPECT_TRUE(lines.Next(&line));
    TextFields points(line, {images_file, "line", lines.number()});
    for (int64_t i = 0; !points.AtEnd(); ++i) {
      const double x = points.Number("x").value();
      const double y = points.Number("y").value();
      EXPECT_TRUE(points.Number("point").ok());
      observations[{id, i}] = {x, y};
    }
  }
  return observations;
}

TEST_F(RealScenes, HerzjesuPointsReprojectWhereTheyWereSeen) {
  const Stopwatch stopwatch;
  const Scene scene = Import("herzjesu-rendered");
  EXPECT_LT(stopwatch.Seconds(), 1);
  ASSERT_EQ(scene.points.size(), 10693);

  const std::string model = JoinPath(DataFolder(), "herzjesu-rendered/model");
  std::map<int64_t, std::string> names;
  const auto observations = ReadObservations(model + "/images.txt", &names);
  const std::string text = ReadFile(model + "/points3D.txt").value();
  TextLines lines(text);
  std::string_view line;
  int64_t checked = 0;
  double sum = 0;
  while (lines.NextContent(&line)) {
    TextFields point(line, {"points3D.txt", "line", lines.number()});
    double values[8];
    for (double& value : values) value = point.Number("point").value();
    while (!point.AtEnd()) {
      const int64_t image = point.Integer("image", 0, 1000).value();
      const int64_t index = point.Integer("index", 0, 1000000).value();
      for (const SceneView& view : scene.views) {
        if (view.name != names[image]) continue;
        const Camera camera = UndistortedCamera(view, 0);
        const Eigen::Vector3d x_in_cam = camera.CamFromWorld({values[1], values[2], values[3]});
        ASSERT_GT(x_in_cam.z(), 0);
        const double error = (camera.ProjectFromCam(x_in_cam) - observations.at({image, index})).norm();
        EXPECT_LT(error, 5);
        sum += error;
        ++checked;
      }
    }
  }
  EXPECT_EQ(checked, 48108);  // as the file's header says: 10693 points, mean track length 4.499
  EXPECT_LT(sum / static_cast<double>(checked), 0.5);
}

TEST_F(RealScenes, ViewsLoad) {
  for (const char* name : {"templeSparseRing", "fountain-P11", "herzjesu-rendered"}) {
    const Scene scene = Import(name);
    const absl::StatusOr<View> view = LoadView(scene.views.at(0), 512);
    ASSERT_TRUE(view.ok()) << view.status();
    EXPECT_EQ(view->color.width, 512) << name;
  }
}

}  // namespace
}  // namespace meshwright
