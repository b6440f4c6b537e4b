// SPDX-License-Identifier: Apache-2.0
#include "worker/tie_points/tie_points.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "worker/testing/synthetic_views.h"

namespace meshwright {
namespace {

using testing_world::MakeSyntheticViews;
using testing_world::SyntheticViews;

constexpr int kCells = 24;

class TiePointsTest : public testing::Test {
 protected:
  static void SetUpTestSuite() { views_ = new SyntheticViews(MakeSyntheticViews(3)); }
  static void TearDownTestSuite() { delete views_; }

  // The cameras of all targets say that their pictures lie by so much beside where they are.
  static PatchScorer ScorerWithTargetsMoved(const Eigen::Vector2d& by_px) {
    const auto view = [&](int i, const Eigen::Vector2d& moved_px) {
      const auto index = static_cast<size_t>(i);
      Camera camera = views_->scene.cameras[index];
      camera.cx += moved_px.x();
      camera.cy += moved_px.y();
      return ScoredView{camera, std::make_shared<SamplingImage>(ToGrey(views_->scene.images[index]), 3)};
    };
    std::vector<ScoredView> targets;
    for (const int target : views_->targets) targets.push_back(view(target, by_px));
    return PatchScorer(view(views_->reference, {0, 0}), targets, {.window_radius = 5});
  }

  // How far from its true place each sight is, px, ascending.
  static std::vector<double> Errors(const std::vector<TiePoint>& ties) {
    std::vector<double> errors;
    for (const TiePoint& tie : ties) {
      const Lattice& lattice = views_->lattice;
      const Eigen::Vector2d at = lattice.FromPixel(tie.pixel.cast<double>());
      const int64_t node = lattice.Index(static_cast<int>(std::lround(at.x())), static_cast<int>(std::lround(at.y())));
      const Eigen::Vector3d x_in_world = views_->reference_camera().BackProject(
          tie.pixel.x(), tie.pixel.y(), views_->truth.depth[static_cast<size_t>(node)]);
      for (const TiePoint::Sight& sight : tie.sights) {
        const auto view = static_cast<size_t>(views_->targets[static_cast<size_t>(sight.target)]);
        const Camera& camera = views_->scene.cameras[view];
        errors.push_back((camera.ProjectFromCam(camera.CamFromWorld(x_in_world)) - sight.pixel.cast<double>()).norm());
      }
    }
    std::ranges::sort(errors);
    return errors;
  }

  static std::vector<Seed> Seeds() { return views_->TrueSeeds(views_->Scorer(), 1); }

  static SyntheticViews* views_;
};
SyntheticViews* TiePointsTest::views_ = nullptr;

TEST_F(TiePointsTest, PlacesAreTrueWhateverTheCamerasSay) {
  ThreadPool pool(2);
  for (const Eigen::Vector2d& moved : {Eigen::Vector2d(0, 0), Eigen::Vector2d(0.5, -0.3), Eigen::Vector2d(-2, 1.5)}) {
    const std::vector<TiePoint> ties =
        MeasureTiePoints(ScorerWithTargetsMoved(moved), views_->lattice, Seeds(), kCells, pool);
    const std::vector<double> errors = Errors(ties);
    ASSERT_GT(errors.size(), 200) << moved.transpose();
    EXPECT_LT(errors[errors.size() / 2], 0.3) << moved.transpose();
    EXPECT_LT(errors[errors.size() * 9 / 10], 0.9) << moved.transpose();
  }
}

TEST_F(TiePointsTest, WhatIsOutOfReachIsNotMeasured) {
  ThreadPool pool(2);
  const auto near = MeasureTiePoints(ScorerWithTargetsMoved({0, 0}), views_->lattice, Seeds(), kCells, pool);
  const auto far =
      MeasureTiePoints(ScorerWithTargetsMoved({3.0 * kTieReachPx, 0}), views_->lattice, Seeds(), kCells, pool);
  EXPECT_LT(far.size(), near.size() / 4);
}

TEST_F(TiePointsTest, SpreadOverCells) {
  ThreadPool pool(2);
  constexpr int kFew = 5;
  const Camera& camera = views_->reference_camera();
  std::set<std::pair<int, int>> cells;
  const auto ties = MeasureTiePoints(ScorerWithTargetsMoved({0, 0}), views_->lattice, Seeds(), kFew, pool);
  for (const TiePoint& tie : ties) {
    const auto cell = std::pair(static_cast<int>(tie.pixel.x()) * kFew / camera.width,
                                static_cast<int>(tie.pixel.y()) * kFew / camera.height);
    EXPECT_TRUE(cells.insert(cell).second) << "two in one cell";
  }
  EXPECT_GT(cells.size(), kFew * kFew / 2);
}

TEST_F(TiePointsTest, NumberOfThreadsChangesNothing) {
  ThreadPool one(1);
  ThreadPool three(3);
  const PatchScorer scorer = ScorerWithTargetsMoved({0.4, 0.8});
  const auto a = MeasureTiePoints(scorer, views_->lattice, Seeds(), kCells, one);
  const auto b = MeasureTiePoints(scorer, views_->lattice, Seeds(), kCells, three);
  ASSERT_EQ(a.size(), b.size());
  for (size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].pixel, b[i].pixel);
    ASSERT_EQ(a[i].sights.size(), b[i].sights.size());
    for (size_t k = 0; k < a[i].sights.size(); ++k) EXPECT_EQ(a[i].sights[k].pixel, b[i].sights[k].pixel);
  }
}

TEST_F(TiePointsTest, NoSeedsNoPoints) {
  ThreadPool pool(1);
  EXPECT_TRUE(MeasureTiePoints(ScorerWithTargetsMoved({0, 0}), views_->lattice, {}, kCells, pool).empty());
}

}  // namespace
}  // namespace meshwright
