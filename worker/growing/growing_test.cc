// SPDX-License-Identifier: Apache-2.0
#include "worker/growing/growing.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "worker/growing/open_queue.h"
#include "worker/testing/synthetic_views.h"

namespace meshwright {
namespace {

using testing_world::MakeSyntheticViews;
using testing_world::SyntheticViews;

class GrowingTest : public testing::Test {
 protected:
  static void SetUpTestSuite() { views_ = new SyntheticViews(MakeSyntheticViews(2)); }
  static void TearDownTestSuite() { delete views_; }

  static PatchStacks GrowAll(const AcceptedDepth& accepted, int threads, int stride = 16) {
    ThreadPool pool(threads);
    const PatchScorer scorer = views_->Scorer();
    return Grow(scorer, views_->TrueSeeds(scorer, stride), accepted, {}, pool);
  }

  static SyntheticViews* views_;
};
SyntheticViews* GrowingTest::views_ = nullptr;

TEST_F(GrowingTest, FollowsTheTrueSurface) {
  const PatchStacks stacks = GrowAll(AcceptedDepth::Empty(views_->reference_camera(), 2), 2);
  int64_t visible = 0;
  for (const float z : views_->truth.depth) visible += z > 0 ? 1 : 0;
  EXPECT_GT(stacks.CountRays(), visible / 2);
  int64_t near = 0;
  for (const GrownPatch& patch : stacks.patches) near += views_->ErrorInSteps(patch.node, patch.plane.w) < 2 ? 1 : 0;
  EXPECT_GT(static_cast<double>(near), 0.85 * static_cast<double>(stacks.patches.size()));
}

TEST_F(GrowingTest, KeepsTheFiveConditions) {
  const GrowingOptions options;
  const PatchStacks stacks = GrowAll(AcceptedDepth::Empty(views_->reference_camera(), 2), 2, 4);
  for (int64_t node = 0; node < stacks.lattice.nodes(); ++node) {
    std::vector<GrownPatch> ray;
    for (int32_t i = stacks.first[static_cast<size_t>(node)]; i >= 0; i = stacks.patches[static_cast<size_t>(i)].next) {
      ray.push_back(stacks.patches[static_cast<size_t>(i)]);
      EXPECT_EQ(ray.back().node, node);
    }
    EXPECT_LE(static_cast<int>(ray.size()), options.max_patches_per_ray);
    for (size_t a = 0; a < ray.size(); ++a) {
      EXPECT_GT(ray[a].quality, options.min_quality);
      for (size_t b = a + 1; b < ray.size(); ++b) {
        EXPECT_NE(ray[a].seed, ray[b].seed);
        const float step = InverseDepthStep(views_->reference_camera(), 2, std::max(ray[a].plane.w, ray[b].plane.w));
        EXPECT_GT(std::fabs(ray[a].plane.w - ray[b].plane.w), 0.95F * step);
      }
    }
  }
}

TEST_F(GrowingTest, NumberOfThreadsChangesNothing) {
  const AcceptedDepth accepted = AcceptedDepth::Empty(views_->reference_camera(), 2);
  const PatchStacks one = GrowAll(accepted, 1, 8);
  const PatchStacks three = GrowAll(accepted, 3, 8);
  ASSERT_EQ(one.patches.size(), three.patches.size());
  EXPECT_EQ(one.tentative_patches_scored, three.tentative_patches_scored);
  for (size_t i = 0; i < one.patches.size(); ++i) {
    ASSERT_EQ(one.patches[i].node, three.patches[i].node);
    ASSERT_EQ(one.patches[i].plane.w, three.patches[i].plane.w);
    ASSERT_EQ(one.patches[i].quality, three.patches[i].quality);
  }
}

TEST_F(GrowingTest, NothingGrowsOnOrBehindWhatIsAccepted) {
  AcceptedDepth accepted = AcceptedDepth::Empty(views_->reference_camera(), 2);
  for (int64_t node = 0; node < accepted.lattice.nodes(); ++node) {
    const bool left_half = node % accepted.lattice.columns < accepted.lattice.columns / 2;
    if (left_half) accepted.depth[static_cast<size_t>(node)] = views_->truth.depth[static_cast<size_t>(node)];
  }
  const PatchStacks stacks = GrowAll(accepted, 2);
  int64_t on_the_right = 0;
  for (const GrownPatch& patch : stacks.patches) {
    if (patch.node % accepted.lattice.columns >= accepted.lattice.columns / 2) {
      ++on_the_right;
    } else {
      EXPECT_LT(1 / patch.plane.w, accepted.depth[static_cast<size_t>(patch.node)]);
    }
  }
  EXPECT_GT(on_the_right, 0);
}

// A target that sees half of the wall ends nothing: growing goes on in those that see the other half.
TEST_F(GrowingTest, GoesOnInOtherTargetsWhereItsOwnSeeNothing) {
  ThreadPool pool(2);
  std::vector<Seed> seeds = views_->TrueSeeds(views_->Scorer(), 8);
  const Lattice& lattice = views_->lattice;
  const auto is_left = [&](int32_t node) { return node % lattice.columns < lattice.columns / 2; };
  std::erase_if(seeds, [&](const Seed& seed) { return !is_left(seed.node) || (seed.sigma & 1U) == 0; });
  ASSERT_GT(seeds.size(), 30U);
  for (Seed& seed : seeds) seed.sigma = 1;
  const auto share_right = [&](const PatchScorer& scorer) {
    const PatchStacks stacks =
        Grow(scorer, seeds, AcceptedDepth::Empty(views_->reference_camera(), 2), GrowingOptions(), pool);
    int64_t right = 0;
    int64_t near = 0;
    for (const GrownPatch& patch : stacks.patches) {
      if (is_left(patch.node)) continue;
      ++right;
      near += views_->ErrorInSteps(patch.node, patch.plane.w) < 2 ? 1 : 0;
    }
    EXPECT_GE(static_cast<double>(near), 0.8 * static_cast<double>(right));
    return static_cast<double>(right) / (0.5 * static_cast<double>(lattice.nodes()));
  };
  const double all_seen = share_right(views_->Scorer());
  const double half_seen = share_right(views_->Scorer({}, 0.5));
  EXPECT_GT(half_seen, 0.8 * all_seen) << "of " << all_seen;
}

TEST_F(GrowingTest, NoSeedsNoPatches) {
  ThreadPool pool(1);
  const PatchScorer scorer = views_->Scorer();
  const PatchStacks stacks = Grow(scorer, {}, AcceptedDepth::Empty(views_->reference_camera(), 2), {}, pool);
  EXPECT_TRUE(stacks.patches.empty());
  EXPECT_EQ(stacks.CountRays(), 0);
}

TEST(OpenQueue, BestFirstAndNothingLost) {
  OpenQueue queue;
  for (int i = 0; i < 1000; ++i) queue.Push(i, static_cast<float>((i * 7919) % 1000) / 1000.0F);
  std::vector<int32_t> batch;
  std::vector<bool> seen(1000, false);
  int last_bucket = 1 << 20;
  while (queue.Pop(64, batch)) {
    for (const int32_t i : batch) {
      const int bucket = static_cast<int>((static_cast<float>((i * 7919) % 1000) / 1000.0F + 1) * 0.5F * 512);
      EXPECT_LE(bucket, last_bucket);
      last_bucket = bucket;
      EXPECT_FALSE(seen[static_cast<size_t>(i)]);
      seen[static_cast<size_t>(i)] = true;
    }
  }
  EXPECT_EQ(std::count(seen.begin(), seen.end(), true), 1000);
}

TEST(GrowingOptions, ValidateNamesTheField) {
  GrowingOptions options;
  EXPECT_TRUE(options.Validate().ok());
  options.max_patches_per_ray = 0;
  EXPECT_NE(options.Validate().ToString().find("max_patches_per_ray"), std::string::npos);
}

}  // namespace
}  // namespace meshwright
