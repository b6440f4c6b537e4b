// SPDX-License-Identifier: Apache-2.0
#include "pipeline/refinement/refine_cameras.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tools/synthetic/synthetic_scene.h"

namespace meshwright {
namespace {

using testing::HasSubstr;

// A walk along a house front, with cameras that are turned by so much from those that took the photographs.
SyntheticScene Facade(double off_px, int sparse_points_per_camera = 100) {
  ThreadPool pool(2);
  return MakeSyntheticScene({.cameras = 8,
                             .width = 400,
                             .height = 300,
                             .camera_noise_px = off_px,
                             .sparse_points_per_camera = sparse_points_per_camera},
                            pool)
      .value();
}

class Refiner {
 public:
  explicit Refiner(int threads) : pool_(threads) {}

  absl::StatusOr<CameraRefinement> Refine(const SyntheticScene& synthetic, const ReconstructionOptions& options = {}) {
    // Photographs that are in memory only.
    const auto load = [&](CameraIndex camera, int max_image_size) -> absl::StatusOr<View> {
      ++loaded_;
      if (fails_) return absl::InvalidArgumentError("cannot be read");
      const auto index = static_cast<size_t>(camera);
      return View{.camera = UndistortedCamera(synthetic.scene.views[index], max_image_size),
                  .color = synthetic.images[index],
                  .ignored = {}};
    };
    const auto progress = [&](double done) {
      EXPECT_GE(done, done_);
      EXPECT_LE(done, 1);
      done_ = done;
      return done < stop_at_;
    };
    done_ = 0;
    return RefineCameras(synthetic.scene, options, {.load = load, .pool = &pool_, .progress = progress});
  }

  ThreadPool pool_;
  double done_ = 0;
  double stop_at_ = 2;
  int loaded_ = 0;
  bool fails_ = false;
};

TEST(RefineCameras, ExactCamerasStayToTheLastBit) {
  const SyntheticScene exact = Facade(0);
  const auto refinement = Refiner(2).Refine(exact);
  ASSERT_TRUE(refinement.ok()) << refinement.status();
  EXPECT_FALSE(refinement->moved());
  EXPECT_EQ(refinement->reason, "");
  EXPECT_GT(refinement->tie_points, 300);
  EXPECT_LT(refinement->error_px_before, 0.3);
  EXPECT_EQ(refinement->off_px, 0);
}

TEST(RefineCameras, WrongOnesAreFoundAndSaidToBeOffByWhatTheyAre) {
  for (const double off_px : {0.5, 3.0}) {
    const auto refinement = Refiner(2).Refine(Facade(off_px));
    ASSERT_TRUE(refinement.ok()) << refinement.status();
    ASSERT_TRUE(refinement->moved()) << off_px;
    EXPECT_LT(refinement->error_px_after, 0.3) << off_px;
    EXPECT_LT(refinement->error_px_after, 0.7 * refinement->error_px_before) << off_px;
    EXPECT_GT(refinement->off_px, 0.4 * off_px);
    EXPECT_LT(refinement->off_px, 2 * off_px);
  }
}

TEST(RefineCameras, SparsePointsAreNotNeeded) {
  const auto refinement = Refiner(2).Refine(Facade(1, 0));
  ASSERT_TRUE(refinement.ok()) << refinement.status();
  EXPECT_TRUE(refinement->moved());
  EXPECT_LT(refinement->error_px_after, 0.3);
}

// What they see stays where it is: the frame of the scene is its maker's.
TEST(RefineCameras, TheFrameStays) {
  SyntheticScene scene = Facade(1);
  const auto refinement = Refiner(2).Refine(scene);
  ASSERT_TRUE(refinement.ok() && refinement->moved());
  ASSERT_TRUE(ApplyRefinement(*refinement, scene.scene).ok());
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  double depth = 0;
  for (size_t i = 0; i < scene.cameras.size(); ++i) {
    const Camera refined = UndistortedCamera(scene.scene.views[i], 0);
    shift += refined.center_in_world() - scene.cameras[i].center_in_world();
    depth += refined.CamFromWorld(scene.scene.points.front().x_in_world).z();
  }
  EXPECT_LT(shift.norm() / depth, 0.004);
}

TEST(RefineCameras, NumberOfThreadsChangesNothing) {
  const SyntheticScene scene = Facade(0.7);
  const auto by_one = Refiner(1).Refine(scene);
  const auto by_three = Refiner(3).Refine(scene);
  ASSERT_TRUE(by_one.ok() && by_three.ok());
  EXPECT_EQ(EncodeCameraRefinement(*by_one), EncodeCameraRefinement(*by_three));
}

TEST(RefineCameras, OptionsSayWhetherAndStopsAreHeard) {
  const SyntheticScene scene = Facade(0.7);
  Refiner refiner(1);
  ReconstructionOptions options;
  for (const auto& [most, why] : {std::pair(0, "not asked for"), std::pair(7, "too many photographs")}) {
    options.refine_cameras = most;
    const auto refinement = refiner.Refine(scene, options);
    ASSERT_TRUE(refinement.ok());
    EXPECT_FALSE(refinement->moved());
    EXPECT_THAT(refinement->reason, HasSubstr(why));
  }
  EXPECT_EQ(refiner.loaded_, 0);
  refiner.stop_at_ = 0.2;
  EXPECT_TRUE(absl::IsCancelled(refiner.Refine(scene).status()));
  refiner.stop_at_ = 2;
  refiner.fails_ = true;
  EXPECT_TRUE(absl::IsInvalidArgument(refiner.Refine(scene).status()));
}

TEST(RefineCameras, PhotographsThatSayNothingLeaveCamerasAlone) {
  SyntheticScene scene = Facade(0.7);
  for (ColorImage& image : scene.images) image.rgb.assign(image.rgb.size(), 128);
  const auto grey = Refiner(1).Refine(scene);
  ASSERT_TRUE(grey.ok()) << grey.status();
  EXPECT_FALSE(grey->moved());
  EXPECT_THAT(grey->reason, HasSubstr("too few points"));
  // No two cameras see anything in common: whoever looks for pairs next says so.
  scene.scene.points.clear();
  for (size_t i = 0; i < scene.scene.views.size(); ++i) {
    scene.scene.views[i].cam_from_world.translation = Eigen::Vector3d(1e6 * static_cast<double>(i), 0, 0);
  }
  const auto apart = Refiner(1).Refine(scene);
  ASSERT_TRUE(apart.ok()) << apart.status();
  EXPECT_THAT(apart->reason, HasSubstr("no pair"));
}

}  // namespace
}  // namespace meshwright
