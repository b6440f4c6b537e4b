// SPDX-License-Identifier: Apache-2.0
#include "worker/completion/completion.h"

#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <random>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

namespace meshwright {
namespace {

constexpr int kStep = 2;
constexpr float kFocal = 400;
const PatchPlane kWall{0.2F, 1e-4F, -2e-4F};  // at the top-left pixel

// A photograph without any texture but where a test puts some, and the surface of a wall that a test punches holes
// into.
class CompleteSurfaceTest : public testing::Test {
 protected:
  CompleteSurfaceTest()
      : camera_{.width = 160, .height = 120, .fx = kFocal, .fy = kFocal, .cx = 80, .cy = 60},
        lattice_(Lattice::For(camera_, kStep)),
        grey_{.width = camera_.width,
              .height = camera_.height,
              .grey =
                  std::vector<uint8_t>(static_cast<size_t>(camera_.width) * static_cast<size_t>(camera_.height), 120)},
        surface_(lattice_),
        accepted_(AcceptedDepth::Empty(camera_, kStep)) {
    for (int row = 0; row < lattice_.rows; ++row) {
      for (int column = 0; column < lattice_.columns; ++column) Put(column, row, WallAt(column, row));
    }
  }

  PatchPlane WallAt(int column, int row) const {
    return kWall.MovedBy(static_cast<float>(lattice_.PixelX(column)), static_cast<float>(lattice_.PixelY(row)));
  }

  void Put(int column, int row, const PatchPlane& plane) {
    const auto node = static_cast<size_t>(lattice_.Index(column, row));
    surface_.plane[node] = plane;
    surface_.quality[node] = plane.w > 0 ? 0.9F : 0;
  }

  void Punch(int left, int top, int right, int bottom) {
    for (int row = top; row < bottom; ++row) {
      for (int column = left; column < right; ++column) Put(column, row, {});
    }
  }

  int64_t Complete(const CompletionOptions& options = {}, int threads = 2) {
    PatchScorer::Options scoring;
    const PatchScorer scorer({camera_, std::make_shared<SamplingImage>(grey_, 1)}, {}, scoring, region_);
    ThreadPool pool(threads);
    return CompleteSurface(scorer, accepted_, std::vector<PatchPlane>(surface_.plane.size()), options, surface_, pool);
  }

  void Paint(int x, int y, uint8_t grey) {
    grey_.grey[static_cast<size_t>(y) * static_cast<size_t>(grey_.width) + static_cast<size_t>(x)] = grey;
  }

  bool HasPatch(int column, int row) const { return surface_.HasPatch(lattice_.Index(column, row)); }

  // Distance from the wall, in d_r.
  float OffWall(int column, int row) const {
    const float w = WallAt(column, row).w;
    const float found = surface_.plane[static_cast<size_t>(lattice_.Index(column, row))].w;
    return std::fabs(found - w) / (w * kStep / kFocal);
  }

  Camera camera_;
  Lattice lattice_;
  GreyImage grey_;
  SurfaceEstimate surface_;
  AcceptedDepth accepted_;
  std::optional<OrientedBox> region_;
};

TEST_F(CompleteSurfaceTest, APlaneClosesTheHoleThatItSurrounds) {
  std::mt19937 random(3);
  std::normal_distribution<float> noise(0, 0.2F);
  for (PatchPlane& plane : surface_.plane) plane.w *= 1 + noise(random) * kStep / kFocal;
  const std::vector<PatchPlane> before = surface_.plane;
  Punch(25, 20, 50, 40);
  EXPECT_EQ(Complete(), 25 * 20);
  for (int row = 0; row < lattice_.rows; ++row) {
    for (int column = 0; column < lattice_.columns; ++column) {
      const auto node = static_cast<size_t>(lattice_.Index(column, row));
      const bool is_inside = column >= 25 && column < 50 && row >= 20 && row < 40;
      EXPECT_EQ(surface_.quality[node] == PatchLattice::kInferredQuality, is_inside);
      if (is_inside) {
        EXPECT_LT(OffWall(column, row), 0.5F) << column << ", " << row;
      } else {
        EXPECT_EQ(surface_.plane[node].w, before[node].w) << "what was measured stays";
      }
    }
  }
  // It hangs together, and with what is around it.
  for (int column = 24; column < 50; ++column) {
    EXPECT_TRUE((surface_.links[static_cast<size_t>(lattice_.Index(column, 30))] & PatchLattice::kLinkRight) != 0);
  }
}

TEST_F(CompleteSurfaceTest, NothingIsExtendedBeyondARim) {
  // Half a wall: nothing is around the other half.
  Punch(40, 0, lattice_.columns, lattice_.rows);
  EXPECT_EQ(Complete(), 0);
}

TEST_F(CompleteSurfaceTest, WhereThePictureEndsThePlaneGoesOn) {
  Punch(25, 35, 50, lattice_.rows);
  const int64_t hole = 25 * (lattice_.rows - 35);
  EXPECT_GT(Complete(), hole * 2 / 3);
  for (int row = 35; row < lattice_.rows; ++row) {
    for (int column = 25; column < 50; ++column) {
      if (!HasPatch(column, row)) continue;
      EXPECT_LT(OffWall(column, row), 0.5F) << column << ", " << row;
    }
  }
}

TEST_F(CompleteSurfaceTest, SkyAboveARoofIsNoWallThatThePictureCuts) {
  // It rises to the left.
  for (int row = 0; row < 20; ++row) Punch(20 + row, row, lattice_.columns, row + 1);
  EXPECT_EQ(Complete(), 0);
}

TEST_F(CompleteSurfaceTest, InferredSurfaceIsSmoothHoweverRoughItsRim) {
  std::mt19937 random(7);
  std::normal_distribution<float> noise(0, 0.4F);
  for (PatchPlane& plane : surface_.plane) plane.w *= 1 + noise(random) * kStep / kFocal;
  Punch(25, 20, 50, 40);
  Complete();
  float bends = 0;  // of the noise's unit, d_r
  for (int row = 20; row < 40; ++row) {
    for (int column = 26; column + 1 < 50; ++column) {
      const auto w = [&](int c) { return surface_.plane[static_cast<size_t>(lattice_.Index(c, row))].w; };
      bends += std::fabs(w(column - 1) - 2 * w(column) + w(column + 1)) / w(column) * kFocal / kStep;
    }
  }
  EXPECT_LT(bends / (20 * 23), 0.04F);
}

TEST_F(CompleteSurfaceTest, WhatIsAroundMustBeOnePlane) {
  // A pit whose rim is a staircase, each stair 5 d_r behind the one before.
  for (int row = 0; row < lattice_.rows; ++row) {
    for (int column = 0; column < lattice_.columns; ++column) {
      PatchPlane plane = WallAt(column, row);
      plane.w *= 1 - 5.0F * static_cast<float>((row / 4) * (row / 4) % 7 + column / 12) * kStep / kFocal;
      Put(column, row, plane);
    }
  }
  Punch(25, 20, 50, 40);
  EXPECT_LT(Complete(), 25 * 20 / 10);
}

TEST_F(CompleteSurfaceTest, WhereThereWasTextureNothingIsInferred) {
  std::mt19937 random(4);
  Punch(25, 20, 50, 40);
  for (int y = 0; y < camera_.height; ++y) {
    for (int x = 0; x < camera_.width / 2; ++x) Paint(x, y, static_cast<uint8_t>(100 + random() % 40));
  }
  Complete();
  EXPECT_FALSE(HasPatch(30, 30));
  EXPECT_TRUE(HasPatch(47, 30));
}

TEST_F(CompleteSurfaceTest, AcceptedSurfaceIsAmongWhatIsAround) {
  Punch(0, 0, lattice_.columns, lattice_.rows);
  for (int row = 0; row < lattice_.rows; ++row) {
    for (int column = 0; column < lattice_.columns; ++column) {
      if (column >= 25 && column < 50 && row >= 20 && row < 40) continue;
      accepted_.depth[static_cast<size_t>(lattice_.Index(column, row))] = 1 / WallAt(column, row).w;
    }
  }
  EXPECT_EQ(Complete(), 25 * 20) << "where there is accepted surface nothing is inferred";
  EXPECT_LT(OffWall(37, 30), 0.5F);
}

TEST_F(CompleteSurfaceTest, CrumbsAreNotBuiltOn) {
  Punch(25, 20, 50, 40);
  for (const int column : {30, 36, 42}) {
    PatchPlane crumb = WallAt(column, 30);
    crumb.w *= 1.2F;
    Put(column, 30, crumb);
  }
  EXPECT_EQ(Complete(), 25 * 20 - 3);
  EXPECT_LT(OffWall(31, 30), 0.5F);
}

TEST_F(CompleteSurfaceTest, ReachAndRegionBoundIt) {
  Punch(25, 20, 50, 40);
  const SurfaceEstimate with_hole = surface_;
  EXPECT_EQ(Complete({.max_reach = 0}), 0);
  const int64_t near = Complete({.max_reach = 0.1});
  EXPECT_GT(near, 0);
  EXPECT_LT(near, 25 * 20);
  // A box that ends before the wall.
  surface_ = with_hole;
  OrientedBox box;
  box.size = Eigen::Vector3d(20, 20, 6);
  region_ = box;
  EXPECT_EQ(Complete(), 0);
  EXPECT_FALSE(CompletionOptions{.max_reach = 1.5}.Validate().ok());
}

TEST_F(CompleteSurfaceTest, ABlackBackdropSeenThroughAnObjectStaysOpen) {
  Punch(25, 20, 50, 40);
  for (int y = 0; y < camera_.height; ++y) {
    for (int x = 0; x < camera_.width; ++x) {
      const bool at_border = x < 8 || y < 8 || x >= camera_.width - 8 || y >= camera_.height - 8;
      const bool in_hole = x >= 50 && x < 100 && y >= 40 && y < 80;
      if (at_border || in_hole) Paint(x, y, 10);
    }
  }
  EXPECT_EQ(Complete(), 0);
}

TEST_F(CompleteSurfaceTest, NumberOfThreadsChangesNothing) {
  std::mt19937 random(6);
  for (PatchPlane& plane : surface_.plane) {
    plane.w *= 1 + static_cast<float>(random() % 100) / 100.0F * kStep / kFocal;
    if (random() % 3 == 0) plane = {};
  }
  const SurfaceEstimate with_holes = surface_;
  Complete({}, 1);
  const SurfaceEstimate one = std::exchange(surface_, with_holes);
  Complete({}, 5);
  for (size_t i = 0; i < one.plane.size(); ++i) {
    EXPECT_EQ(one.plane[i].w, surface_.plane[i].w);
    EXPECT_EQ(one.plane[i].gx, surface_.plane[i].gx);
  }
  EXPECT_EQ(one.links, surface_.links);
}

}  // namespace
}  // namespace meshwright
