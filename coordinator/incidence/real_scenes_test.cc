// SPDX-License-Identifier: Apache-2.0
// The paper's own photographs: feasible pairs and overlaps as a person would judge them.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <gtest/gtest.h>

#include "coordinator/incidence/feasible_pairs.h"
#include "coordinator/incidence/overlap_graph.h"
#include "coordinator/incidence/target_selection.h"

namespace meshwright {
namespace {

std::filesystem::path DataFolder() {
  const char* folder = std::getenv("MESHWRIGHT_TEST_DATA");
  return folder != nullptr ? folder : "../shared/data";
}

Eigen::Matrix3d ReadMatrix(std::istream& in) {
  Eigen::Matrix3d matrix;
  for (int i = 0; i < 9; ++i) in >> matrix(i / 3, i % 3);
  return matrix;
}

Camera MakeCamera(const Eigen::Matrix3d& k, int width, int height) {
  return {.width = width, .height = height, .fx = k(0, 0), .fy = k(1, 1), .cx = k(0, 2) + 0.5, .cy = k(1, 2) + 0.5};
}

// Cameras only, without the importers: this room's tests stand on their own.
std::vector<Camera> StrechaCameras(const std::string& scene) {
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(DataFolder() / scene / "cameras")) {
    files.push_back(entry.path().string());
  }
  std::sort(files.begin(), files.end());
  std::vector<Camera> cameras;
  for (const std::string& file : files) {
    std::ifstream in(file);
    const Eigen::Matrix3d k = ReadMatrix(in);
    double zero = 0;
    in >> zero >> zero >> zero;
    const Eigen::Matrix3d world_from_cam = ReadMatrix(in);
    Eigen::Vector3d center;
    int width = 0;
    int height = 0;
    in >> center.x() >> center.y() >> center.z() >> width >> height;
    Camera camera = MakeCamera(k, width, height);
    camera.cam_from_world = {world_from_cam.transpose(), -(world_from_cam.transpose() * center)};
    cameras.push_back(camera);
  }
  return cameras;
}

std::vector<Camera> MiddleburyCameras(const std::string& scene, const std::string& parameters) {
  std::ifstream in(DataFolder() / scene / parameters);
  int count = 0;
  in >> count;
  std::vector<Camera> cameras;
  for (int i = 0; i < count; ++i) {
    std::string name;
    in >> name;
    Camera camera = MakeCamera(ReadMatrix(in), 640, 480);
    camera.cam_from_world.rotation = ReadMatrix(in);
    Eigen::Vector3d& t = camera.cam_from_world.translation;
    in >> t.x() >> t.y() >> t.z();
    cameras.push_back(camera);
  }
  return cameras;
}

class RealScene : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(DataFolder())) GTEST_SKIP() << "no real scenes at " << DataFolder();
  }
  // Fails the test when there is no pair.
  void Load(std::vector<Camera> cameras) {
    cameras_ = std::move(cameras);
    ThreadPool pool(2);
    absl::StatusOr<FeasiblePairs> pairs = FindFeasiblePairs(cameras_, {}, {}, pool);
    ASSERT_TRUE(pairs.ok()) << pairs.status();
    pairs_ = *std::move(pairs);
    geometries_ = CameraGeometries(cameras_);
    overlaps_ = FindOverlaps(geometries_, pairs_.probes, pairs_.matrix, {}, pool);
  }
  int MinPairs() const {
    int least = pairs_.matrix.cameras();
    for (CameraIndex i = 0; i < pairs_.matrix.cameras(); ++i) least = std::min(least, pairs_.matrix.RowSum(i));
    return least;
  }
  double AngleBetweenAxesDeg(CameraIndex i, CameraIndex j) const {
    const double cosine =
        geometries_[static_cast<size_t>(i)].axis_in_world.dot(geometries_[static_cast<size_t>(j)].axis_in_world);
    return std::acos(std::clamp(cosine, -1.0, 1.0)) * 180 / std::numbers::pi;
  }

  std::vector<Camera> cameras_;
  std::vector<CameraGeometry> geometries_;
  FeasiblePairs pairs_;
  OverlapGraph overlaps_;
};

TEST_F(RealScene, FountainP11) {
  Load(StrechaCameras("fountain-P11"));
  ASSERT_EQ(cameras_.size(), 11U);
  EXPECT_GE(MinPairs(), 3);
  for (CameraIndex i = 0; i + 1 < 11; ++i) EXPECT_TRUE(pairs_.matrix.Get(i, i + 1)) << i;
  for (CameraIndex i = 0; i < 11; ++i) EXPECT_EQ(overlaps_.Of(i).size(), 10U) << "all see the fountain";
}

TEST_F(RealScene, CastleP30) {
  Load(StrechaCameras("castle-P30"));
  ASSERT_EQ(cameras_.size(), 30U);
  EXPECT_GE(MinPairs(), 2);
  EXPECT_EQ(pairs_.counts.cameras_without_pair, 0);
  for (CameraIndex i = 0; i < 30; ++i) {
    for (const CameraIndex j : pairs_.matrix.Neighbours(i)) EXPECT_LT(AngleBetweenAxesDeg(i, j), 100);
  }
}

TEST_F(RealScene, TempleRings) {
  for (const auto& [scene, parameters, least] :
       {std::tuple("templeSparseRing", "templeSR_par.txt", 2), std::tuple("templeRing", "templeR_par.txt", 8),
        std::tuple("temple", "temple_par.txt", 30)}) {
    Load(MiddleburyCameras(scene, parameters));
    EXPECT_GE(MinPairs(), least) << scene;
    for (CameraIndex i = 0; i < pairs_.matrix.cameras(); ++i) {
      for (const CameraIndex j : pairs_.matrix.Neighbours(i)) EXPECT_LT(AngleBetweenAxesDeg(i, j), 60);
      for (const CameraIndex j : overlaps_.Of(i)) EXPECT_LT(AngleBetweenAxesDeg(i, j), 150) << "nobody sees the back";
      const std::vector<CameraIndex> targets =
          ChooseTargets(i, pairs_.matrix.Neighbours(i), geometries_, pairs_.probes, {});
      EXPECT_EQ(targets.size(), std::min<size_t>(8, pairs_.matrix.Neighbours(i).size()));
    }
  }
}

}  // namespace
}  // namespace meshwright
