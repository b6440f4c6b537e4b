// SPDX-License-Identifier: Apache-2.0
#include "worker/filtering/epipolar_offsets.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "worker/testing/synthetic_views.h"

namespace meshwright {
namespace {

using testing_world::MakeSyntheticViews;
using testing_world::SyntheticViews;

class EpipolarOffsetsTest : public testing::Test {
 protected:
  static void SetUpTestSuite() { views_ = new SyntheticViews(MakeSyntheticViews(2)); }
  static void TearDownTestSuite() { delete views_; }

  // The cameras of both targets say that their pictures lie by so much beside where they are, across epipolar lines.
  static PatchScorer ScorerWithTargetsMoved(float across_px) {
    std::vector<Camera> cameras;
    for (const int i : {views_->reference, 1, 3}) cameras.push_back(views_->scene.cameras[static_cast<size_t>(i)]);
    const PatchScorer true_scorer = ScorerOf(cameras);
    const Lattice& lattice = views_->lattice;
    const int64_t middle = lattice.Index(lattice.columns / 2, lattice.rows / 2);
    for (int target = 0; target < 2; ++target) {
      const Eigen::Vector2f across = true_scorer.AcrossEpipolarLine(
          lattice.PixelX(lattice.columns / 2), lattice.PixelY(lattice.rows / 2), views_->TruePlane(middle).w, target);
      cameras[static_cast<size_t>(target) + 1].cx += across_px * across.x();
      cameras[static_cast<size_t>(target) + 1].cy += across_px * across.y();
    }
    return ScorerOf(cameras);
  }

  static PatchScorer ScorerOf(const std::vector<Camera>& cameras) {
    const auto view = [&](size_t i, int image) {
      const GreyImage grey = ToGrey(views_->scene.images[static_cast<size_t>(image)]);
      return ScoredView{cameras[i], std::make_shared<SamplingImage>(grey, 3)};
    };
    return PatchScorer(view(0, views_->reference), {view(1, 1), view(2, 3)}, {});
  }

  // The true surface, seen by both targets.
  static SurfaceEstimate Truth() {
    SurfaceEstimate surface(views_->lattice);
    for (int64_t node = 0; node < surface.lattice.nodes(); ++node) {
      surface.plane[static_cast<size_t>(node)] = views_->TruePlane(node);
      if (surface.HasPatch(node)) surface.sigma[static_cast<size_t>(node)] = 0b11;
    }
    return surface;
  }

  static double OffPx(const EpipolarOffsets& offsets) {
    return std::sqrt(std::max(0.0, offsets.sum_of_squares / static_cast<double>(offsets.measurements)));
  }

  static SyntheticViews* views_;
};
SyntheticViews* EpipolarOffsetsTest::views_ = nullptr;

TEST_F(EpipolarOffsetsTest, TellsHowFarPicturesAreOff) {
  ThreadPool pool(2);
  for (const float moved : {0.0F, 0.5F, 1.0F, 2.0F}) {
    const EpipolarOffsets offsets = MeasureEpipolarOffsets(ScorerWithTargetsMoved(moved), Truth(), pool);
    EXPECT_GT(offsets.measurements, 200) << moved;
    EXPECT_NEAR(OffPx(offsets), moved, 0.1 + 0.1 * moved);
  }
}

TEST_F(EpipolarOffsetsTest, NothingMeasuredWithoutASurface) {
  ThreadPool pool(1);
  const EpipolarOffsets offsets =
      MeasureEpipolarOffsets(ScorerWithTargetsMoved(0), SurfaceEstimate(views_->lattice), pool);
  EXPECT_EQ(offsets.measurements, 0);
  EXPECT_EQ(offsets.sum_of_squares, 0);
}

TEST_F(EpipolarOffsetsTest, NumberOfThreadsChangesNothing) {
  const PatchScorer scorer = ScorerWithTargetsMoved(0.7F);
  ThreadPool one(1);
  ThreadPool three(3);
  const EpipolarOffsets a = MeasureEpipolarOffsets(scorer, Truth(), one);
  const EpipolarOffsets b = MeasureEpipolarOffsets(scorer, Truth(), three);
  EXPECT_EQ(a.measurements, b.measurements);
  EXPECT_EQ(a.sum_of_squares, b.sum_of_squares);
}

}  // namespace
}  // namespace meshwright
