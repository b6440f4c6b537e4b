// SPDX-License-Identifier: Apache-2.0
#include "pipeline/local/time_estimate.h"

#include <cstdlib>
#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tools/synthetic/synthetic_scene.h"

#include "common/base/bad_input.h"
#include "common/base/check.h"
#include "common/scene/formats/import.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

class TimeEstimateTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    std::string pattern = testing::TempDir() + "time_estimate_XXXXXX";
    MW_CHECK(mkdtemp(pattern.data()) != nullptr);
    folder_ = new std::string(pattern);
    ThreadPool pool(2);
    const SyntheticOptions options = {.kind = SyntheticKind::kRing, .cameras = 8, .width = 320, .height = 240};
    MW_CHECK(WriteSyntheticScene(*MakeSyntheticScene(options, pool), *folder_, pool).ok());
    scene_ = new Scene(*ImportScene(*folder_, {}));
  }
  static void TearDownTestSuite() { fs::remove_all(*folder_); }

  static inline std::string* folder_ = nullptr;
  static inline Scene* scene_ = nullptr;
};

TEST_F(TimeEstimateTest, MoreRaysTakeLongerAndThreadsShareThem) {
  ReconstructionOptions coarse;
  coarse.job.lattice_step = 8;
  ReconstructionOptions fine;
  fine.job.lattice_step = 1;
  const TimeEstimate quick = *EstimateTime(*scene_, coarse, 1);
  const TimeEstimate slow = *EstimateTime(*scene_, fine, 1);
  EXPECT_GT(quick.cpu_seconds, 0);
  EXPECT_GT(slow.cpu_seconds, 2 * quick.cpu_seconds);
  EXPECT_EQ(quick.wall_seconds, quick.cpu_seconds);
  const TimeEstimate shared = *EstimateTime(*scene_, fine, 4);
  EXPECT_LT(shared.wall_seconds, 0.5 * shared.cpu_seconds);
}

TEST_F(TimeEstimateTest, ItSaysWhatItRestsOn) {
  const TimeEstimate estimate = *EstimateTime(*scene_, {}, 2);
  EXPECT_EQ(estimate.cameras, static_cast<int>(scene_->views.size()));
  EXPECT_EQ(estimate.tried.size(), 2);
  EXPECT_GE(estimate.tried_lattice_step, ReconstructionOptions().job.lattice_step);
  EXPECT_GT(estimate.expected_share_grown, 0);
  EXPECT_LT(estimate.expected_share_grown, 1);
  for (const std::string& name : estimate.tried) EXPECT_THAT(ToText(estimate), testing::HasSubstr(name));
}

TEST_F(TimeEstimateTest, AScenesFaultsAreBadInput) {
  Scene alone = *scene_;
  alone.views.resize(1);
  alone.points.clear();
  EXPECT_TRUE(IsBadInput(EstimateTime(alone, {}, 1).status()));
  Scene gone = *scene_;
  for (SceneView& view : gone.views) view.image_path += ".gone";
  EXPECT_TRUE(IsBadInput(EstimateTime(gone, {}, 1).status()));
}

}  // namespace
}  // namespace meshwright
