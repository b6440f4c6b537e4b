// SPDX-License-Identifier: Apache-2.0
#include "worker/filtering/filtering.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "worker/testing/synthetic_views.h"

namespace meshwright {
namespace {

using testing_world::MakeSyntheticViews;
using testing_world::SyntheticViews;

class FilteringTest : public testing::Test {
 protected:
  static void SetUpTestSuite() { views_ = new SyntheticViews(MakeSyntheticViews(2)); }
  static void TearDownTestSuite() { delete views_; }

  static FilteringResult Filter(int threads, PatchStacks* stacks_out = nullptr) {
    ThreadPool pool(threads);
    const PatchScorer scorer = views_->Scorer();
    const PatchStacks stacks =
        Grow(scorer, views_->TrueSeeds(scorer, 8), AcceptedDepth::Empty(views_->reference_camera(), 2), {}, pool);
    if (stacks_out != nullptr) *stacks_out = stacks;
    return FilterPatches(stacks, views_->reference_camera(), {}, pool);
  }

  static double MedianErrorInSteps(const SurfaceEstimate& surface) {
    std::vector<double> errors;
    for (int64_t node = 0; node < surface.lattice.nodes(); ++node) {
      if (surface.HasPatch(node))
        errors.push_back(views_->ErrorInSteps(node, surface.plane[static_cast<size_t>(node)].w));
    }
    std::nth_element(errors.begin(), errors.begin() + static_cast<int64_t>(errors.size() / 2), errors.end());
    return errors[errors.size() / 2];
  }

  static SyntheticViews* views_;
};
SyntheticViews* FilteringTest::views_ = nullptr;

TEST_F(FilteringTest, KeepsMostOfTheTruthAndLittleElse) {
  PatchStacks stacks;
  const FilteringResult result = Filter(2, &stacks);
  int64_t kept = 0;
  int64_t near = 0;
  for (int64_t node = 0; node < stacks.lattice.nodes(); ++node) {
    if (!result.surface.HasPatch(node)) continue;
    ++kept;
    near += views_->ErrorInSteps(node, result.surface.plane[static_cast<size_t>(node)].w) < 3 ? 1 : 0;
  }
  EXPECT_GT(kept, stacks.CountRays() / 2);
  EXPECT_GT(static_cast<double>(near), 0.9 * static_cast<double>(kept));
  EXPECT_LE(result.lower_bound, result.energy + 1e-6 * std::fabs(result.energy));
}

TEST_F(FilteringTest, LinksJoinPatchesOnly) {
  const FilteringResult result = Filter(1);
  const Lattice& lattice = result.surface.lattice;
  int64_t links = 0;
  for (int row = 0; row < lattice.rows; ++row) {
    for (int column = 0; column < lattice.columns; ++column) {
      const int64_t node = lattice.Index(column, row);
      const uint8_t bits = result.surface.links[static_cast<size_t>(node)];
      if ((bits & PatchLattice::kLinkRight) != 0) {
        ++links;
        ASSERT_LT(column + 1, lattice.columns);
        EXPECT_TRUE(result.surface.HasPatch(node) && result.surface.HasPatch(node + 1));
      }
      if ((bits & PatchLattice::kLinkDown) != 0) {
        ++links;
        ASSERT_LT(row + 1, lattice.rows);
        EXPECT_TRUE(result.surface.HasPatch(node) && result.surface.HasPatch(node + lattice.columns));
      }
    }
  }
  EXPECT_GT(links, 0);
}

TEST_F(FilteringTest, RefinementBringsDepthNearerToTheTruth) {
  FilteringResult result = Filter(2);
  const double before = MedianErrorInSteps(result.surface);
  ThreadPool pool(2);
  RefineSurface(views_->Scorer(), {}, result.surface, pool);
  const double after = MedianErrorInSteps(result.surface);
  EXPECT_LT(after, before);
  EXPECT_LT(after, 0.35);
}

TEST_F(FilteringTest, RefinementDropsUncertainPatchesWithTheirLinks) {
  FilteringResult result = Filter(2);
  const SurfaceEstimate before = result.surface;
  ThreadPool pool(2);
  RefineSurface(views_->Scorer(), {}, result.surface, pool);
  const SurfaceEstimate& after = result.surface;
  int64_t dropped = 0;
  int64_t dropped_wrong = 0;
  int64_t kept = 0;
  int64_t kept_wrong = 0;
  for (int64_t node = 0; node < after.lattice.nodes(); ++node) {
    if (!before.HasPatch(node)) {
      EXPECT_FALSE(after.HasPatch(node));
      continue;
    }
    const auto i = static_cast<size_t>(node);
    const int wrong = views_->ErrorInSteps(node, before.plane[i].w) > 1 ? 1 : 0;
    (after.HasPatch(node) ? kept : dropped) += 1;
    (after.HasPatch(node) ? kept_wrong : dropped_wrong) += wrong;
    if ((after.links[i] & PatchLattice::kLinkRight) != 0) {
      EXPECT_TRUE(after.HasPatch(node) && after.HasPatch(node + 1));
    }
    if ((after.links[i] & PatchLattice::kLinkDown) != 0) {
      EXPECT_TRUE(after.HasPatch(node) && after.HasPatch(node + after.lattice.columns));
    }
  }
  ASSERT_GT(dropped, 0);
  // What is dropped is wrong more often than what stays.
  EXPECT_GT(dropped_wrong * kept, kept_wrong * dropped);
}

TEST_F(FilteringTest, NumberOfThreadsChangesNothing) {
  FilteringResult one = Filter(1);
  FilteringResult three = Filter(3);
  ThreadPool pool_of_one(1);
  ThreadPool pool_of_three(3);
  RefineSurface(views_->Scorer(), {}, one.surface, pool_of_one);
  RefineSurface(views_->Scorer(), {}, three.surface, pool_of_three);
  EXPECT_EQ(one.energy, three.energy);
  for (size_t i = 0; i < one.surface.plane.size(); ++i) {
    ASSERT_EQ(one.surface.plane[i].w, three.surface.plane[i].w);
    ASSERT_EQ(one.surface.plane[i].gx, three.surface.plane[i].gx);
    ASSERT_EQ(one.surface.links[i], three.surface.links[i]);
  }
}

TEST_F(FilteringTest, SurfaceHasUnitNormalsTowardsTheCamera) {
  const FilteringResult result = Filter(1);
  const PatchLattice surface = MakeFilteredSurface(result.surface, 7, views_->reference_camera(),
                                                   views_->scene.images[static_cast<size_t>(views_->reference)]);
  EXPECT_EQ(surface.camera_index, 7);
  for (int row = 0; row < surface.lattice.rows; ++row) {
    for (int column = 0; column < surface.lattice.columns; ++column) {
      const int64_t node = surface.lattice.Index(column, row);
      if (!surface.HasPatch(node)) continue;
      const Eigen::Vector3f normal = surface.normal_in_world[static_cast<size_t>(node)];
      EXPECT_NEAR(normal.norm(), 1, 1e-4);
      const Eigen::Vector3f to_camera =
          (views_->reference_camera().center_in_world() - surface.Point(column, row)).cast<float>();
      EXPECT_GT(normal.dot(to_camera), 0);
    }
  }
}

TEST(FilteringOptions, ValidateNamesTheField) {
  FilteringOptions options;
  EXPECT_TRUE(options.Validate().ok());
  options.max_plane_distance_steps = 0;
  EXPECT_NE(options.Validate().ToString().find("max_plane_distance_steps"), std::string::npos);
}

}  // namespace
}  // namespace meshwright
