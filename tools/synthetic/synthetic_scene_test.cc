// SPDX-License-Identifier: Apache-2.0
#include "tools/synthetic/synthetic_scene.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tools/raycast/depth_map.h"
#include "tools/raycast/mesh_ray_caster.h"

#include "common/mesh/ply.h"
#include "common/scene/formats/import.h"
#include "common/scene/view.h"

namespace meshwright {
namespace {

using ::testing::HasSubstr;
using ::testing::TestWithParam;
using ::testing::Values;

SyntheticScene Make(const SyntheticOptions& options, int threads = 2) {
  ThreadPool pool(threads);
  auto scene = MakeSyntheticScene(options, pool);
  EXPECT_TRUE(scene.ok()) << scene.status();
  return *std::move(scene);
}

double Grey(const std::array<uint8_t, 3>& rgb) { return 0.3 * rgb[0] + 0.59 * rgb[1] + 0.11 * rgb[2]; }

double GreyAt(const ColorImage& image, const Eigen::Vector2d& pixel) {
  const double x = pixel.x() - 0.5;
  const double y = pixel.y() - 0.5;
  const int column = static_cast<int>(x);
  const int row = static_cast<int>(y);
  const double a = x - column;
  const double b = y - row;
  return (1 - b) * ((1 - a) * Grey(image.At(column, row)) + a * Grey(image.At(column + 1, row))) +
         b * ((1 - a) * Grey(image.At(column, row + 1)) + a * Grey(image.At(column + 1, row + 1)));
}

class EverySyntheticKind : public TestWithParam<SyntheticKind> {
 protected:
  static SyntheticOptions Small(int cameras) {
    return {.kind = GetParam(), .cameras = cameras, .width = 160, .height = 120, .noise_sigma = 0};
  }
};

TEST_P(EverySyntheticKind, TheSameSeedGivesTheSameBytesWithAnyNumberOfThreads) {
  SyntheticOptions options = Small(3);
  options.noise_sigma = 2;
  const SyntheticScene a = Make(options, 1);
  const SyntheticScene b = Make(options, 3);
  options.seed = 2;
  const SyntheticScene c = Make(options);
  ASSERT_EQ(a.images.size(), 3);
  for (size_t i = 0; i < a.images.size(); ++i) {
    EXPECT_EQ(a.images[i].rgb, b.images[i].rgb);
    EXPECT_NE(a.images[i].rgb, c.images[i].rgb);
    EXPECT_EQ(a.cameras[i].cam_from_world.translation, b.cameras[i].cam_from_world.translation);
  }
  EXPECT_EQ(a.ground_truth.positions, b.ground_truth.positions);
  ASSERT_EQ(a.scene.points.size(), b.scene.points.size());
  for (size_t i = 0; i < a.scene.points.size(); ++i) {
    EXPECT_EQ(a.scene.points[i].x_in_world, b.scene.points[i].x_in_world);
    EXPECT_EQ(a.scene.points[i].seen_by, b.scene.points[i].seen_by);
  }
}

TEST_P(EverySyntheticKind, TheGroundTruthIsAProperMesh) {
  const TriangleMesh mesh = Make(Small(2)).ground_truth;
  ASSERT_FALSE(mesh.faces.empty());
  ASSERT_EQ(mesh.normals.size(), mesh.positions.size());
  for (const Eigen::Vector3f& x : mesh.positions) ASSERT_TRUE(x.allFinite());
  int64_t agreeing = 0;
  int64_t with_area = 0;
  for (const auto& face : mesh.faces) {
    ASSERT_LT(*std::max_element(face.begin(), face.end()), mesh.positions.size());
    const Eigen::Vector3f a = mesh.positions[face[0]];
    const Eigen::Vector3f normal = (mesh.positions[face[1]] - a).cross(mesh.positions[face[2]] - a);
    if (normal.norm() < 1e-9F) continue;
    ++with_area;
    agreeing += normal.dot(mesh.normals[face[0]] + mesh.normals[face[1]] + mesh.normals[face[2]]) > 0 ? 1 : 0;
  }
  EXPECT_GT(static_cast<double>(agreeing), 0.999 * static_cast<double>(with_area));
}

// What a camera sees is seen from outside, and from every other camera it is either seen at the same place or hidden by
// something before it.
TEST_P(EverySyntheticKind, DepthsOfDifferentViewsAgree) {
  const SyntheticScene scene = Make(Small(6));
  const MeshRayCaster caster(scene.ground_truth);
  ThreadPool pool(2);
  int64_t outside = 0;
  int64_t inside = 0;
  int64_t same = 0;
  int64_t hidden = 0;
  for (size_t i = 0; i < scene.cameras.size(); ++i) {
    const Camera& camera = scene.cameras[i];
    const Camera& other = scene.cameras[(i + 1) % scene.cameras.size()];
    const DepthMap map = RenderDepth(caster, camera, 2, pool);
    for (int row = 0; row < map.lattice.rows; ++row) {
      for (int column = 0; column < map.lattice.columns; ++column) {
        const auto node = static_cast<size_t>(map.lattice.Index(column, row));
        if (map.depth[node] <= 0) continue;
        const Eigen::Vector2d pixel = map.lattice.Pixel(column, row);
        const Eigen::Vector3d x = camera.BackProject(pixel.x(), pixel.y(), map.depth[node]);
        ++(caster.FaceNormal(map.face[node]).dot(x - camera.center_in_world()) < 0 ? outside : inside);
        const Eigen::Vector3d x_in_other = other.CamFromWorld(x);
        if (x_in_other.z() <= 0 || !other.Contains(other.ProjectFromCam(x_in_other))) continue;
        const RayHit hit = caster.Cast(other.center_in_world(), x - other.center_in_world());
        ASSERT_TRUE(hit.ok());
        ASSERT_LT(hit.distance, 1 + 1e-3);
        ++(hit.distance > 1 - 1e-3 ? same : hidden);
      }
    }
  }
  EXPECT_GT(outside, 0.15 * 6 * 80 * 60);
  EXPECT_LT(static_cast<double>(inside), 0.001 * static_cast<double>(outside));
  EXPECT_GT(same, hidden);
  EXPECT_GT(hidden, 0);
}

TEST_P(EverySyntheticKind, ASurfacePointHasTheSameColourInAllViews) {
  SyntheticOptions options = Small(8);
  options.width = 320;
  options.height = 240;
  options.sparse_points_per_camera = 100;
  const SyntheticScene scene = Make(options);
  std::vector<double> differences;
  double spread = 0;
  for (const SparsePoint& point : scene.scene.points) {
    const auto grey_in = [&](CameraIndex i) {
      const Camera& camera = scene.cameras[static_cast<size_t>(i)];
      const Eigen::Vector2d pixel = camera.ProjectFromCam(camera.CamFromWorld(point.x_in_world));
      EXPECT_TRUE(camera.Contains(pixel, 1));
      return GreyAt(scene.images[static_cast<size_t>(i)], pixel);
    };
    const double first = grey_in(point.seen_by[0]);
    differences.push_back(std::abs(first - grey_in(point.seen_by[1])));
    spread += std::abs(first - 128);
  }
  ASSERT_GT(differences.size(), 100);
  std::nth_element(differences.begin(), differences.begin() + differences.size() / 2, differences.end());
  EXPECT_LT(differences[differences.size() / 2], 8);
  EXPECT_GT(spread / static_cast<double>(differences.size()), 20);
}

TEST_P(EverySyntheticKind, ViewsHangTogetherBySparsePoints) {
  for (const int cameras : {2, 10, 24}) {
    const SyntheticScene scene = Make(Small(cameras));
    ASSERT_EQ(scene.scene.views.size(), static_cast<size_t>(cameras));
    if (cameras < 10) continue;
    for (CameraIndex i = 0; i < cameras; ++i) {
      std::vector<int> shared(static_cast<size_t>(cameras), 0);
      for (const SparsePoint& point : scene.scene.points) {
        if (!std::binary_search(point.seen_by.begin(), point.seen_by.end(), i)) continue;
        for (const CameraIndex other : point.seen_by) ++shared[static_cast<size_t>(other)];
      }
      shared[static_cast<size_t>(i)] = 0;
      EXPECT_GE(*std::max_element(shared.begin(), shared.end()), 10) << "view " << i << " of " << cameras;
    }
  }
}

// As photographs do, the pictures have places with texture and places without.
TEST_P(EverySyntheticKind, PicturesHaveTexturedAndPlainPlaces) {
  SyntheticOptions options = Small(2);
  options.width = 400;
  options.height = 300;
  const SyntheticScene scene = Make(options);
  int64_t plain = 0;
  int64_t textured = 0;
  for (const ColorImage& image : scene.images) {
    for (int row = 2; row + 2 < image.height; row += 3) {
      for (int column = 2; column + 2 < image.width; column += 3) {
        double low = 255;
        double high = 0;
        for (int y = row - 2; y <= row + 2; ++y) {
          for (int x = column - 2; x <= column + 2; ++x) {
            low = std::min(low, Grey(image.At(x, y)));
            high = std::max(high, Grey(image.At(x, y)));
          }
        }
        plain += high - low < 8 ? 1 : 0;
        textured += high - low > 25 ? 1 : 0;
      }
    }
  }
  const int64_t all = 2 * (396 / 3) * (296 / 3);
  EXPECT_GT(static_cast<double>(plain), 0.03 * static_cast<double>(all));
  EXPECT_GT(static_cast<double>(textured), 0.15 * static_cast<double>(all));
}

TEST_P(EverySyntheticKind, WhatIsWrittenReadsBack) {
  const SyntheticScene scene = Make(Small(3));
  const std::string folder = ::testing::TempDir() + "synthetic_scene_test_" + SyntheticKindName(GetParam());
  ThreadPool pool(2);
  const absl::Status written = WriteSyntheticScene(scene, folder, pool);
  ASSERT_TRUE(written.ok()) << written;
  const auto read = ImportScene(folder);
  ASSERT_TRUE(read.ok()) << read.status();
  ASSERT_EQ(read->views.size(), scene.scene.views.size());
  EXPECT_EQ(read->points.size(), scene.scene.points.size());
  for (size_t i = 0; i < read->views.size(); ++i) {
    EXPECT_EQ(read->views[i].name, scene.scene.views[i].name);
    const auto view = LoadView(read->views[i], 0);
    ASSERT_TRUE(view.ok()) << view.status();
    EXPECT_EQ(view->color.rgb, scene.images[i].rgb);
    EXPECT_EQ(view->camera.fx, scene.cameras[i].fx);
    EXPECT_TRUE(view->camera.cam_from_world.rotation.isApprox(scene.cameras[i].cam_from_world.rotation, 1e-12));
  }
  const auto mesh = ReadPly(folder + "/ground_truth.ply");
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_EQ(mesh->positions, scene.ground_truth.positions);
  EXPECT_EQ(mesh->faces, scene.ground_truth.faces);
  std::filesystem::remove_all(folder);
}

std::string KindName(const ::testing::TestParamInfo<SyntheticKind>& info) { return SyntheticKindName(info.param); }

INSTANTIATE_TEST_SUITE_P(Kinds, EverySyntheticKind,
                         Values(SyntheticKind::kFacade, SyntheticKind::kRing, SyntheticKind::kRoom,
                                SyntheticKind::kStreet),
                         KindName);

// What ordinary photographs suffer: other exposures, compression, cameras that are a little off.
TEST(SyntheticScenePhotographyTest, ExposureCompressionAndCameraNoiseAreAsAskedFor) {
  SyntheticOptions options{.kind = SyntheticKind::kRoom, .cameras = 8, .width = 160, .height = 120, .noise_sigma = 0};
  const SyntheticScene exact = Make(options);
  options.exposure_ev = 0.5;
  const SyntheticScene exposed = Make(options);
  double least = 1e9;
  double most = 0;
  for (size_t i = 0; i < exact.images.size(); ++i) {
    double before = 0;
    double after = 0;
    for (size_t k = 0; k < exact.images[i].rgb.size(); ++k) {
      const double level = exact.images[i].rgb[k];
      if (level < 20 || level > 140) continue;  // neither may be clipped
      before += level * level;
      after += static_cast<double>(exposed.images[i].rgb[k]) * exposed.images[i].rgb[k];
    }
    least = std::min(least, std::log2(after / before));
    most = std::max(most, std::log2(after / before));
  }
  EXPECT_GT(least, -0.56);
  EXPECT_LT(least, -0.1);
  EXPECT_LT(most, 0.56);
  EXPECT_GT(most, 0.1);

  options.exposure_ev = 0;
  options.jpeg_quality = 60;
  options.camera_noise_px = 0.5;
  const SyntheticScene off = Make(options);
  double squares = 0;
  for (size_t i = 0; i < off.cameras.size(); ++i) {
    EXPECT_NE(off.images[i].rgb, exact.images[i].rgb);
    EXPECT_EQ(off.cameras[i].cam_from_world.rotation, exact.cameras[i].cam_from_world.rotation);
    Camera said = off.cameras[i];
    said.cam_from_world = off.scene.views[i].cam_from_world;
    EXPECT_TRUE(said.center_in_world().isApprox(off.cameras[i].center_in_world(), 1e-9));
    const Eigen::Vector3d x = off.cameras[i].BackProject(80, 60, 3);
    squares += (said.ProjectFromCam(said.CamFromWorld(x)) - Eigen::Vector2d(80, 60)).squaredNorm();
  }
  const double per_axis = std::sqrt(squares / (2.0 * static_cast<double>(off.cameras.size())));
  EXPECT_GT(per_axis, 0.25);
  EXPECT_LT(per_axis, 1.0);
}

TEST(SyntheticStreetTest, GrowsWithTheCamerasAndIsInNoOrder) {
  SyntheticOptions options{.kind = SyntheticKind::kStreet, .cameras = 20, .width = 64, .height = 64};
  options.sparse_points_per_camera = 0;
  const SyntheticScene few = Make(options);
  options.cameras = 60;
  const SyntheticScene many = Make(options);
  EXPECT_GT(many.ground_truth.faces.size(), 1.5 * static_cast<double>(few.ground_truth.faces.size()));
  EXPECT_TRUE(many.scene.points.empty());
  int forward = 0;
  for (size_t i = 1; i < many.cameras.size(); ++i) {
    forward += many.cameras[i].center_in_world().x() > many.cameras[i - 1].center_in_world().x() ? 1 : 0;
  }
  EXPECT_GT(forward, 15);
  EXPECT_LT(forward, 45);
}

TEST(SyntheticOptionsTest, NamesTheFieldThatIsOutOfRange) {
  EXPECT_THAT(SyntheticOptions{.cameras = 1}.Validate().ToString(), HasSubstr("cameras is 1, expected 2 .. 24"));
  EXPECT_THAT(SyntheticOptions{.width = 5}.Validate().ToString(), HasSubstr("width is 5"));
  EXPECT_THAT(SyntheticOptions{.noise_sigma = std::nan("")}.Validate().ToString(), HasSubstr("noise_sigma"));
  EXPECT_TRUE((SyntheticOptions{.kind = SyntheticKind::kRing, .cameras = 200}).Validate().ok());
  EXPECT_THAT(ParseSyntheticKind("castle").status().ToString(), HasSubstr("\"castle\""));
  for (const auto kind : {SyntheticKind::kFacade, SyntheticKind::kRing, SyntheticKind::kRoom, SyntheticKind::kStreet}) {
    EXPECT_EQ(*ParseSyntheticKind(SyntheticKindName(kind)), kind);
  }
}

}  // namespace
}  // namespace meshwright
