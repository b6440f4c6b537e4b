// SPDX-License-Identifier: Apache-2.0
// The whole way from photographs and a mesh to a textured model, on a scene whose surface is known.

#include <algorithm>
#include <filesystem>
#include <string>

#include <gtest/gtest.h>
#include <unistd.h>

#include "pipeline/texturing/texture_mesh.h"
#include "tools/raycast/mesh_ray_caster.h"
#include "tools/rendering/mesh_renderer.h"
#include "tools/rendering/picture_comparison.h"
#include "tools/rendering/textured_model.h"
#include "tools/synthetic/synthetic_scene.h"

#include "common/base/check.h"
#include "common/base/files.h"
#include "common/mesh/formats/mesh_format.h"
#include "common/scene/view.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

constexpr size_t kKeptBack = 3;

class TextureTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = fs::path(testing::TempDir()) / ("meshwright_texture_" + std::to_string(::getpid()));
    ThreadPool pool(2);
    SyntheticOptions options;
    options.cameras = 8;
    options.width = 400;
    options.height = 300;
    const auto made = MakeSyntheticScene(options, pool);
    MW_CHECK(made.ok());
    MW_CHECK(WriteSyntheticScene(*made, folder_.string(), pool).ok());
    mesh_ = new TriangleMesh(made->ground_truth);
    scene_ = new Scene(made->scene);
    for (SceneView& view : scene_->views) view.image_path = (folder_ / "images" / view.name).string();
    kept_back_ = new SceneView(scene_->views[kKeptBack]);
    scene_->views.erase(scene_->views.begin() + kKeptBack);
  }
  static void TearDownTestSuite() {
    fs::remove_all(folder_);
    delete mesh_;
    delete scene_;
    delete kept_back_;
  }

  static std::string Write(const std::string& name, int threads, TriangleMesh* prepared = nullptr) {
    ThreadPool pool(threads);
    const std::string path = (folder_ / name).string();
    const auto report = WriteTexturedMesh(
        *mesh_, *scene_, {}, **MeshFormatOfPath(name), path, pool, [](int, int) {}, prepared);
    EXPECT_TRUE(report.ok()) << report.status();
    return path;
  }

  // What each vertex looks like on average in the photographs that see it.
  static std::vector<std::array<uint8_t, 3>> MeanColors(const TriangleMesh& mesh) {
    const MeshRayCaster caster(mesh);
    std::vector<Eigen::Vector4d> sums(mesh.positions.size(), Eigen::Vector4d::Zero());
    for (const SceneView& scene_view : scene_->views) {
      const auto view = LoadView(scene_view, 0);
      MW_CHECK(view.ok());
      const Eigen::Vector3d center = view->camera.center_in_world();
      for (size_t v = 0; v < mesh.positions.size(); ++v) {
        const Eigen::Vector3d x = mesh.positions[v].cast<double>();
        const Eigen::Vector3d x_in_cam = view->camera.CamFromWorld(x);
        const Eigen::Vector2d pixel = view->camera.ProjectFromCam(x_in_cam);
        if (!(x_in_cam.z() > 0) || !view->camera.Contains(pixel, 1)) continue;
        if (caster.IsBlocked(center, x - center, 0.01, 0.995)) continue;
        const auto rgb = view->color.At(static_cast<int>(pixel.x()), static_cast<int>(pixel.y()));
        sums[v] += Eigen::Vector4d(rgb[0], rgb[1], rgb[2], 1);
      }
    }
    std::vector<std::array<uint8_t, 3>> colors;
    for (const Eigen::Vector4d& sum : sums) {
      const Eigen::Vector3d mean = sum.head<3>() / std::max(1.0, sum.w());
      colors.push_back(
          {static_cast<uint8_t>(mean.x()), static_cast<uint8_t>(mean.y()), static_cast<uint8_t>(mean.z())});
    }
    return colors;
  }

  static fs::path folder_;
  static TriangleMesh* mesh_;
  static Scene* scene_;
  static SceneView* kept_back_;
};
fs::path TextureTest::folder_;
TriangleMesh* TextureTest::mesh_;
Scene* TextureTest::scene_;
SceneView* TextureTest::kept_back_;

TEST_F(TextureTest, APhotographThatWasKeptBackIsMetBetterThanByColorsOfVertices) {
  ThreadPool pool(2);
  TriangleMesh prepared;
  const auto model = ReadTexturedGlb(Write("model.glb", 2, &prepared));
  ASSERT_TRUE(model.ok()) << model.status();
  const auto photograph = LoadView(*kept_back_, 0);
  ASSERT_TRUE(photograph.ok()) << photograph.status();
  const Camera& camera = photograph->camera;
  const TexturedModelRenderer textured(*model);
  prepared.colors = MeanColors(prepared);
  const MeshRenderer colored(prepared);
  const auto difference = [&](const ColorImage& picture) {
    return CompareWhereCovered(picture, photograph->color, colored.caster(), camera, pool);
  };
  const RenderOptions options = {.shading = Shading::kColors};
  const PictureComparison with_texture = difference(textured.Render(camera, options.background, pool));
  const PictureComparison with_colors = difference(colored.Render(camera, options, pool));
  EXPECT_GT(with_texture.share, 0.5);
  EXPECT_GE(with_texture.psnr_db, with_colors.psnr_db + 3);
}

TEST_F(TextureTest, SeamsDoNotShow) {
  const auto model = ReadTexturedGlb(Write("seams.glb", 2));
  ASSERT_TRUE(model.ok()) << model.status();
  const EdgeJumps jumps = MeasureEdgeJumps(*model);
  EXPECT_GT(jumps.seams, 100);
  EXPECT_LE(jumps.at_seams, jumps.within_charts + 2);
}

TEST_F(TextureTest, ThreadsHaveNoInfluenceOnTheBytes) {
  EXPECT_EQ(*ReadFile(Write("one.glb", 1)), *ReadFile(Write("three.glb", 3)));
}

TEST_F(TextureTest, ObjNamesItsMaterialsAndTheseTheirPictures) {
  const std::string path = Write("my model.obj", 2);
  const std::string object = *ReadFile(path);
  EXPECT_NE(object.find("mtllib my_model.mtl\n"), std::string::npos);
  EXPECT_NE(object.find("usemtl page_0\n"), std::string::npos);
  const auto materials = ReadFile((folder_ / "my_model.mtl").string());
  ASSERT_TRUE(materials.ok()) << materials.status();
  EXPECT_NE(materials->find("newmtl page_0\n"), std::string::npos);
  EXPECT_NE(materials->find("map_Kd my_model_0.jpg\n"), std::string::npos);
  EXPECT_TRUE(fs::exists(folder_ / "my_model_0.jpg"));
}

TEST_F(TextureTest, AMeshThatNoPhotographShowsIsRefused) {
  ThreadPool pool(1);
  TriangleMesh elsewhere = *mesh_;
  for (Eigen::Vector3f& x : elsewhere.positions) x += Eigen::Vector3f::Constant(1e4F);
  const std::string path = (folder_ / "elsewhere.glb").string();
  const auto report = WriteTexturedMesh(elsewhere, *scene_, {}, **MeshFormatByName("glb"), path, pool);
  EXPECT_TRUE(absl::IsFailedPrecondition(report.status())) << report.status();
  EXPECT_FALSE(fs::exists(path));
}

}  // namespace
}  // namespace meshwright
