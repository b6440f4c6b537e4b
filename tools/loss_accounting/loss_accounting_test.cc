// SPDX-License-Identifier: Apache-2.0
#include "tools/loss_accounting/loss_accounting.h"

#include <cmath>
#include <memory>
#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace meshwright {
namespace {

constexpr float kDepth = 10;
constexpr int kCameras = 3;

TriangleMesh Wall() {
  TriangleMesh mesh;
  mesh.positions = {{-20, -20, kDepth}, {-20, 20, kDepth}, {20, 20, kDepth}, {20, -20, kDepth}};
  mesh.faces = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

// Three cameras side by side look at a wall with a pattern; what their jobs found is made up.
class LossAccountingTest : public testing::Test {
 protected:
  LossAccountingTest() {
    for (int i = 0; i < kCameras; ++i) {
      Camera camera{.width = 96, .height = 64, .fx = 100, .fy = 100, .cx = 48, .cy = 32};
      camera.cam_from_world.translation = {-0.5 * i, 0, 0};
      cameras_.push_back(camera);
    }
    losses_ = std::make_unique<LossAccounting>(Wall(), cameras_, options_.lattice_step, pool_);
  }

  // The wall as camera i sees it.
  JobView View(int i) const {
    const auto c = static_cast<size_t>(i);
    GreyImage grey{cameras_[c].width, cameras_[c].height, {}};
    for (int y = 0; y < grey.height; ++y) {
      for (int x = 0; x < grey.width; ++x) {
        const Eigen::Vector3d at = cameras_[c].BackProject(x + 0.5, y + 0.5, kDepth);
        grey.grey.push_back(
            static_cast<uint8_t>(127 + 60 * std::sin(9 * at.x() + 3 * at.y()) + 60 * std::sin(11 * at.y() - at.x())));
      }
    }
    return {i, cameras_[c], std::make_shared<SamplingImage>(grey, 3)};
  }

  CameraJobInput Input(int reference) const {
    CameraJobInput input;
    input.reference = View(reference);
    for (int i = 0; i < kCameras; ++i) {
      if (i != reference) input.targets.push_back(View(i));
    }
    input.accepted = AcceptedDepth::Empty(input.reference.camera, options_.lattice_step);
    return input;
  }

  PatchStacks NothingGrown() const {
    PatchStacks stacks;
    stacks.lattice = Lattice::For(cameras_[0], options_.lattice_step);
    stacks.first.assign(static_cast<size_t>(stacks.lattice.nodes()), -1);
    return stacks;
  }

  PatchStacks GrownAt(float depth) const {
    PatchStacks stacks = NothingGrown();
    for (size_t node = 0; node < stacks.first.size(); ++node) {
      stacks.first[node] = static_cast<int32_t>(node);
      GrownPatch patch;
      patch.plane.w = 1 / depth;
      patch.node = static_cast<int32_t>(node);
      stacks.patches.push_back(patch);
    }
    return stacks;
  }

  PatchLattice Surface(int camera, float depth) const {
    PatchLattice surface = PatchLattice::Empty(camera, cameras_[static_cast<size_t>(camera)], options_.lattice_step);
    surface.depth.assign(surface.depth.size(), depth);
    return surface;
  }

  void Record(int camera, const PatchStacks& grown, float filtered_depth) {
    losses_->RecordJob(Input(camera), options_, grown, Surface(camera, filtered_depth), pool_);
  }

  // Where most pixels were lost; that all pixels are accounted for is checked on the way.
  LossStage MainLoss() {
    const LossReport report = losses_->Account({}, pool_);
    EXPECT_EQ(report.found, 0);
    EXPECT_EQ(report.ground_truth_pixels, kCameras * Lattice::For(cameras_[0], options_.lattice_step).nodes());
    EXPECT_EQ(std::accumulate(report.lost.begin(), report.lost.end(), int64_t{0}), report.ground_truth_pixels);
    const auto most = std::ranges::max_element(report.lost);
    EXPECT_GT(*most, report.ground_truth_pixels / 2);
    return static_cast<LossStage>(most - report.lost.begin());
  }

  ThreadPool pool_{2};
  CameraJobOptions options_;
  std::vector<Camera> cameras_;
  std::unique_ptr<LossAccounting> losses_;
};

TEST_F(LossAccountingTest, EverythingIsFoundInTheTrueMesh) {
  const LossReport report = losses_->Account(Wall(), pool_);
  EXPECT_EQ(report.found, report.ground_truth_pixels);
  EXPECT_EQ(report.cameras_not_followed, kCameras);
}

TEST_F(LossAccountingTest, WhatWouldPassAndWasNotGrownWasNotReached) {
  Record(1, NothingGrown(), 0);
  EXPECT_EQ(MainLoss(), LossStage::kNotReached);
}

TEST_F(LossAccountingTest, WhatNoPhotographConfirmsIsInconsistent) {
  CameraJobInput input = Input(1);
  for (JobView& target : input.targets) {
    GreyImage grey{96, 64, std::vector<uint8_t>(96 * 64)};
    for (size_t i = 0; i < grey.grey.size(); ++i) grey.grey[i] = static_cast<uint8_t>((i * 7919) % 251);
    target.grey = std::make_shared<SamplingImage>(grey, 3);
  }
  losses_->RecordJob(input, options_, NothingGrown(), Surface(1, 0), pool_);
  EXPECT_EQ(MainLoss(), LossStage::kInconsistent);
}

TEST_F(LossAccountingTest, FalseAcceptedSurfaceHides) {
  CameraJobInput input = Input(1);
  input.accepted.depth.assign(input.accepted.depth.size(), 0.5F * kDepth);
  losses_->RecordJob(input, options_, NothingGrown(), Surface(1, 0), pool_);
  EXPECT_EQ(MainLoss(), LossStage::kHidden);
}

TEST_F(LossAccountingTest, TheFurthestStageOfAnyCameraCounts) {
  Record(0, NothingGrown(), 0);
  Record(1, GrownAt(kDepth), 0);
  EXPECT_EQ(MainLoss(), LossStage::kFiltered);
  Record(1, GrownAt(kDepth), kDepth);
  EXPECT_EQ(MainLoss(), LossStage::kUnsupported);
  Record(2, GrownAt(kDepth), kDepth);
  EXPECT_EQ(MainLoss(), LossStage::kRefused);
  losses_->RecordAccepted(Surface(1, kDepth));
  EXPECT_EQ(MainLoss(), LossStage::kLostInJoin);
}

TEST_F(LossAccountingTest, PatchesBesideTheTruthDoNotCount) {
  const float beside = kDepth * (1 + 1.5F * LossAccounting::kToleranceInFootprints / 100);
  Record(1, GrownAt(beside), beside);
  losses_->RecordAccepted(Surface(1, beside));
  EXPECT_EQ(MainLoss(), LossStage::kNotReached);
}

TEST_F(LossAccountingTest, WhatOneCameraSeesIsNobodysFault) {
  const LossAccounting alone(Wall(), {cameras_[0]}, options_.lattice_step, pool_);
  const LossReport report = alone.Account({}, pool_);
  EXPECT_EQ(report.lost[static_cast<size_t>(LossStage::kSeenByOne)], report.ground_truth_pixels);
}

TEST_F(LossAccountingTest, RefusesAGroundTruthThatIsNoMesh) {
  TriangleMesh mesh = Wall();
  EXPECT_TRUE(LossAccounting::Check(mesh).ok());
  mesh.faces.push_back({0, 1, 4});
  EXPECT_THAT(LossAccounting::Check(mesh).message(), testing::HasSubstr("vertex 4"));
  mesh.faces.clear();
  EXPECT_FALSE(LossAccounting::Check(mesh).ok());
}

}  // namespace
}  // namespace meshwright
