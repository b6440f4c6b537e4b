// SPDX-License-Identifier: Apache-2.0
#include "worker/camera_job/camera_job.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/base/clock.h"
#include "common/surface/codec.h"
#include "worker/testing/synthetic_views.h"

namespace meshwright {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing_world::MakeSyntheticViews;
using testing_world::SyntheticViews;

constexpr int kStep = 4;  // px

class CameraJobTest : public testing::Test {
 protected:
  static void SetUpTestSuite() { views_ = new SyntheticViews(MakeSyntheticViews(kStep)); }
  static void TearDownTestSuite() { delete views_; }

  static JobView ViewOf(int camera) {
    const auto i = static_cast<size_t>(camera);
    return {.camera_index = camera,
            .camera = views_->scene.cameras[i],
            .grey = std::make_shared<SamplingImage>(ToGrey(views_->scene.images[i]), 3)};
  }

  static CameraJobInput Input(const std::vector<int>& targets) {
    CameraJobInput input;
    input.reference = ViewOf(views_->reference);
    input.reference_color = std::make_shared<ColorImage>(views_->scene.images[static_cast<size_t>(views_->reference)]);
    for (const int target : targets) input.targets.push_back(ViewOf(target));
    for (const SparsePoint& point : views_->scene.scene.points) {
      const auto& seen_by = point.seen_by;
      if (std::find(seen_by.begin(), seen_by.end(), views_->reference) == seen_by.end()) continue;
      input.sparse_points.push_back(point.x_in_world);
      input.sparse_points_seen_by.push_back(seen_by);
    }
    input.accepted = AcceptedDepth::Empty(views_->reference_camera(), kStep);
    return input;
  }

  static CameraJobResult Run(const CameraJobInput& input, int threads = 2) {
    ThreadPool pool(threads);
    return RunCameraJob(input, {.lattice_step = kStep}, pool);
  }

  // What the job says of itself, but for the seconds.
  static std::vector<double> Counts(const CameraJobReport& report) {
    std::vector<double> counts = {report.mrf_energy, report.mrf_lower_bound};
    for (const int64_t count :
         {report.rays, report.rays_covered_before, report.seeds, report.seeds_from_points,
          report.tentative_patches_scored, report.patches_grown, report.rays_grown, report.rays_filtered}) {
      counts.push_back(static_cast<double>(count));
    }
    return counts;
  }

  static SyntheticViews* views_;
};
SyntheticViews* CameraJobTest::views_ = nullptr;

TEST_F(CameraJobTest, FindsTheSurfaceThatIsThere) {
  const CameraJobResult result = Run(Input(views_->targets));
  int64_t visible = 0;
  int64_t near = 0;
  for (int64_t node = 0; node < views_->lattice.nodes(); ++node) {
    const auto i = static_cast<size_t>(node);
    if (views_->truth.depth[i] > 0) ++visible;
    if (!result.filtered.HasPatch(node) || !(views_->truth.depth[i] > 0)) continue;
    if (views_->ErrorInSteps(node, 1 / result.filtered.depth[i]) < 1) ++near;
  }
  EXPECT_GT(static_cast<double>(near), 0.6 * static_cast<double>(visible));
  EXPECT_GT(static_cast<double>(near), 0.9 * static_cast<double>(result.report.rays_filtered));
  EXPECT_EQ(result.filtered.camera_index, views_->reference);
  EXPECT_THAT(result.weak_targets, IsEmpty());
}

TEST_F(CameraJobTest, TheResultDoesNotDependOnThreads) {
  const CameraJobInput input = Input(views_->targets);
  const CameraJobResult expected = Run(input, 1);
  for (const int threads : {2, 3, 7}) {
    const CameraJobResult result = Run(input, threads);
    EXPECT_EQ(EncodeSurface(result.filtered), EncodeSurface(expected.filtered)) << threads;
    EXPECT_EQ(result.weak_targets, expected.weak_targets) << threads;
    EXPECT_EQ(Counts(result.report), Counts(expected.report)) << threads;
  }
}

TEST_F(CameraJobTest, WithoutTargetsNothingIsFound) {
  const CameraJobResult result = Run(Input({}));
  EXPECT_EQ(result.filtered.CountPatches(), 0);
  EXPECT_EQ(result.filtered.lattice.nodes(), views_->lattice.nodes());
  EXPECT_THAT(result.weak_targets, IsEmpty());
  EXPECT_EQ(result.report.rays, views_->lattice.nodes());
  EXPECT_EQ(result.report.seeds + result.report.patches_grown + result.report.rays_filtered, 0);
}

TEST_F(CameraJobTest, ATargetThatShowsSomethingElseIsWeakAndTheOthersCount) {
  CameraJobInput input = Input({0, 1, 3});
  // A photograph of nothing in the place of camera 1's.
  const Camera& camera = input.targets[1].camera;
  const std::vector<uint8_t> grey(static_cast<size_t>(camera.width) * static_cast<size_t>(camera.height), 128);
  input.targets[1].grey = std::make_shared<SamplingImage>(GreyImage{camera.width, camera.height, grey}, 3);
  const CameraJobResult result = Run(input);
  EXPECT_THAT(result.weak_targets, ElementsAre(1));
  EXPECT_GT(result.report.rays_filtered, result.report.rays / 4);
}

TEST_F(CameraJobTest, WhatIsAcceptedIsNotFoundAgain) {
  CameraJobInput input = Input(views_->targets);
  for (int64_t node = 0; node < views_->lattice.nodes(); ++node) {
    const auto i = static_cast<size_t>(node);
    // The left half.
    if (node % views_->lattice.columns >= views_->lattice.columns / 2) continue;
    input.accepted.depth[i] = static_cast<float>(views_->truth.depth[i]);
    input.accepted.quality[i] = views_->truth.depth[i] > 0 ? 0.9F : 0;
  }
  const CameraJobResult result = Run(input);
  int64_t left = 0;
  int64_t right = 0;
  for (int64_t node = 0; node < views_->lattice.nodes(); ++node) {
    if (!result.filtered.HasPatch(node)) continue;
    ++(input.accepted.depth[static_cast<size_t>(node)] > 0 ? left : right);
  }
  EXPECT_LT(10 * left, right);
  EXPECT_GT(right, result.report.rays / 4);
  EXPECT_THAT(result.weak_targets, IsEmpty()) << "few seeds there do not mean a bad pair";
  const auto covered =
      std::count_if(input.accepted.depth.begin(), input.accepted.depth.end(), [](float depth) { return depth > 0; });
  EXPECT_EQ(result.report.rays_covered_before, covered);
}

TEST_F(CameraJobTest, TheReportAddsUp) {
  const CameraJobInput input = Input(views_->targets);
  ThreadPool pool(2);
  PatchStacks grown;
  const Stopwatch stopwatch;
  const CameraJobResult result = RunFollowedCameraJob(input, {.lattice_step = kStep}, grown, pool);
  const double seconds = stopwatch.Seconds();
  const CameraJobReport& report = result.report;
  EXPECT_EQ(report.rays, views_->lattice.nodes());
  EXPECT_EQ(report.rays_covered_before, 0);
  EXPECT_GT(report.seeds_from_points, 0);
  EXPECT_LE(report.seeds_from_points, report.seeds);
  EXPECT_EQ(report.patches_grown, static_cast<int64_t>(grown.patches.size()));
  EXPECT_EQ(report.rays_grown, grown.CountRays());
  EXPECT_LE(report.rays_grown, report.patches_grown);
  EXPECT_LE(report.rays_filtered, report.rays_grown);
  EXPECT_EQ(report.rays_inferred, result.filtered.CountInferred());
  EXPECT_EQ(report.rays_filtered + report.rays_inferred, result.filtered.CountPatches());
  EXPECT_GE(report.tentative_patches_scored, report.patches_grown - report.seeds);
  EXPECT_LE(report.mrf_lower_bound, report.mrf_energy + 1e-6 * std::fabs(report.mrf_energy));
  EXPECT_LE(report.mrf_energy, FilteringOptions{}.no_patch_cost * static_cast<double>(report.rays))
      << "no patch anywhere would be better";
  for (const double share :
       {report.seconds_seeding, report.seconds_growing, report.seconds_filtering, report.seconds_refinement}) {
    EXPECT_GT(share, 0);
  }
  const double sum =
      report.seconds_seeding + report.seconds_growing + report.seconds_filtering + report.seconds_refinement;
  EXPECT_LE(sum, seconds);
  EXPECT_GT(sum, 0.8 * seconds);
  EXPECT_EQ(report.seconds_visibility, 0) << "is for those who make V_r";
}

TEST_F(CameraJobTest, ReducedJobsAreSmallerUpToTheWidestLattice) {
  const Camera& camera = views_->reference_camera();
  CameraJobOptions options = {.lattice_step = 3};
  EXPECT_EQ(Reduced(options, 0).lattice_step, 3);
  EXPECT_EQ(Reduced(options, 1).lattice_step, 6);
  EXPECT_EQ(Reduced(options, 3).lattice_step, 16);
  EXPECT_EQ(Reduced(options, 1000).lattice_step, 16);
  for (int reduction = 0; reduction < 3; ++reduction) {
    EXPECT_LT(EstimateCameraJobBytes(camera, Reduced(options, reduction + 1)),
              EstimateCameraJobBytes(camera, Reduced(options, reduction)));
  }
}

TEST_F(CameraJobTest, OptionsAreCheckedWithThoseOfTheStages) {
  EXPECT_TRUE(CameraJobOptions{}.Validate().ok());
  EXPECT_EQ(CameraJobOptions{.lattice_step = 17}.Validate().message(), "lattice_step is 17, expected 1..16 px");
  CameraJobOptions options;
  options.growing.max_patches_per_ray = 0;
  EXPECT_EQ(options.Validate().message(), "growing.max_patches_per_ray is 0, expected 1..32");
}

// Noise hides at full size what is still to be seen on photographs of half the size.
TEST_F(CameraJobTest, SmallerPhotographsShowWhatNoiseHides) {
  std::mt19937 generator(7);
  std::normal_distribution<float> noise(0, 18);
  CameraJobInput input = Input(views_->targets);
  const auto add_noise = [&](JobView& view) {
    GreyImage grey = ToGrey(views_->scene.images[static_cast<size_t>(view.camera_index)]);
    for (uint8_t& value : grey.grey) {
      value = static_cast<uint8_t>(std::clamp(static_cast<float>(value) + noise(generator), 0.0F, 255.0F));
    }
    view.grey = std::make_shared<SamplingImage>(grey, 3);
  };
  add_noise(input.reference);
  for (JobView& target : input.targets) add_noise(target);
  ThreadPool pool(2);
  const auto run = [&](int halvings) {
    CameraJobOptions options = {.lattice_step = kStep, .completion = {.max_reach = 0}};
    options.halvings = halvings;
    return RunCameraJob(input, options, pool);
  };
  const CameraJobResult full = run(0);
  EXPECT_EQ(full.report.rays_inferred, 0);
  const CameraJobResult smaller = run(2);
  EXPECT_EQ(smaller.report.rays_filtered, full.report.rays_filtered) << "what is found at full size stays";
  EXPECT_GT(smaller.report.rays_inferred, full.report.rays_filtered / 4);
  int64_t near = 0;
  for (int64_t node = 0; node < views_->lattice.nodes(); ++node) {
    const auto i = static_cast<size_t>(node);
    if (!smaller.filtered.HasPatch(node)) continue;
    if (full.filtered.HasPatch(node)) {
      EXPECT_EQ(smaller.filtered.depth[i], full.filtered.depth[i]);
      EXPECT_FALSE(smaller.filtered.IsInferred(node));
      continue;
    }
    EXPECT_TRUE(smaller.filtered.IsInferred(node));
    near += views_->ErrorInSteps(node, 1 / smaller.filtered.depth[i]) < 2 ? 1 : 0;
  }
  EXPECT_GT(static_cast<double>(near), 0.8 * static_cast<double>(smaller.report.rays_inferred));
}

// Nor beyond a mask, nor where something is accepted.
TEST_F(CameraJobTest, SmallerPhotographsKeepToMasksAndToWhatIsAccepted) {
  CameraJobInput input = Input(views_->targets);
  const ColorImage& image = views_->scene.images[static_cast<size_t>(views_->reference)];
  ColorImage mask{image.width, image.height, std::vector<uint8_t>(image.rgb.size(), 255)};
  for (size_t k = 0; k < mask.rgb.size(); ++k) {
    if (k / 3 % static_cast<size_t>(image.width) >= static_cast<size_t>(image.width) / 2) mask.rgb[k] = 0;
  }
  input.reference.grey = std::make_shared<SamplingImage>(ToGrey(image), 3, IgnoredPixels(mask));
  for (int64_t node = 0; node < views_->lattice.nodes(); ++node) {
    const auto i = static_cast<size_t>(node);
    if (node % views_->lattice.columns < views_->lattice.columns / 4) input.accepted.depth[i] = views_->truth.depth[i];
  }
  const CameraJobResult result = Run(input);
  for (int64_t node = 0; node < views_->lattice.nodes(); ++node) {
    if (!result.filtered.HasPatch(node)) continue;
    EXPECT_LT(node % views_->lattice.columns, views_->lattice.columns / 2);
    if (result.filtered.IsInferred(node)) EXPECT_EQ(input.accepted.depth[static_cast<size_t>(node)], 0);
  }
}

}  // namespace
}  // namespace meshwright
