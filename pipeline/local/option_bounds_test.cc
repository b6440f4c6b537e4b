// SPDX-License-Identifier: Apache-2.0
// Every option at its bounds, and all of them together, through the whole method: there may be nothing to see, but
// nothing overflows, and no process dies.

#include <cstdlib>
#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pipeline/local/local_reconstruction.h"
#include "pipeline/options/option_table.h"
#include "pipeline/options/option_testing.h"
#include "tools/synthetic/synthetic_scene.h"

#include "common/base/check.h"
#include "common/scene/formats/import.h"
#include "worker/camera_job/camera_job.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

class OptionBoundsTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = testing::TempDir() + "bounds_XXXXXX";
    MW_CHECK(mkdtemp(pattern.data()) != nullptr);
    folder_ = pattern;
    ThreadPool pool(2);
    const auto made =
        MakeSyntheticScene({.kind = SyntheticKind::kFacade, .cameras = 4, .width = 96, .height = 72}, pool);
    MW_CHECK(made.ok() && WriteSyntheticScene(*made, folder_ + "/scene", pool).ok());
    auto scene = ImportScene(folder_ + "/scene");
    MW_CHECK(scene.ok());
    scene_ = *std::move(scene);
  }
  void TearDown() override { fs::remove_all(folder_); }

  absl::Status Run(const ReconstructionOptions& options) {
    const LocalSettings settings = {.output_path = folder_ + "/mesh.ply",
                                    .report_path = folder_ + "/report.json",
                                    .work_folder = folder_ + "/work",
                                    .restart = true,
                                    .threads = 2};
    const auto job = [&](const CameraJobInput& input, ThreadPool& pool) {
      return RunCameraJob(input, options.job, pool);
    };
    return ReconstructLocally(scene_, options, settings, job, [](const LocalProgress&) {}).status();
  }

  std::string folder_;
  Scene scene_;
};

void ExpectEnd(const absl::Status& status, const std::string& what) {
  if (status.ok()) return;
  EXPECT_THAT(std::string(status.message()),
              testing::AnyOf(testing::HasSubstr("nothing was reconstructed"), testing::HasSubstr("pair")))
      << what;
}

TEST_F(OptionBoundsTest, EachAlone) {
  ASSERT_TRUE(Run(ReconstructionOptions()).ok());
  for (const Option& option : OptionTable()) {
    for (const double bound : {option.minimum, option.maximum}) {
      ExpectEnd(Run(WithValue(option, bound)), std::string(option.name) + " " + FormatValue(Bound(option, bound)));
    }
  }
}

TEST_F(OptionBoundsTest, AllTogether) {
  ReconstructionOptions least;
  ReconstructionOptions most;
  for (const Option& option : OptionTable()) {
    option.Set(least, Bound(option, option.minimum));
    option.Set(most, Bound(option, option.maximum));
  }
  ExpectEnd(Run(least), "least");
  ExpectEnd(Run(most), "most");
}

TEST_F(OptionBoundsTest, AnImageOfOnePixel) {
  for (const int size : {1, 2, 7, 16}) {
    ReconstructionOptions options;
    options.max_image_size = size;
    ExpectEnd(Run(options), "max-image-size " + std::to_string(size));
  }
}

}  // namespace
}  // namespace meshwright
