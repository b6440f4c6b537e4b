// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include <absl/strings/str_cat.h>
#include <gtest/gtest.h>

#include "pipeline/cameras/estimate_cameras.h"
#include "pipeline/cameras/photographs_testing.h"

#include "common/base/files.h"

namespace meshwright {
namespace {

// Real photographs and the real program: the same cameras to the last bit, whatever the number of threads.
TEST(EstimateCamerasWithColmap, ThreadsHaveNoInfluence) {
  const char* data = std::getenv("MESHWRIGHT_TEST_DATA");
  const std::filesystem::path images =
      std::filesystem::path(data == nullptr ? "../shared/data" : data) / "phone-fox/images";
  if (!std::filesystem::exists(images) || !FindColmap("colmap").ok()) GTEST_SKIP() << "no photographs or no COLMAP";
  const TemporaryFolder folder;
  std::vector<std::filesystem::path> files(std::filesystem::directory_iterator(images), {});
  std::sort(files.begin(), files.end());
  std::filesystem::create_directories(folder / "p");
  for (size_t i = 0; i < 6; ++i)
    std::filesystem::copy(files[i], std::filesystem::path(folder / "p") / files[i].filename());
  std::string models[2];
  for (int i = 0; i < 2; ++i) {
    const std::string scene = folder / absl::StrCat("scene", i);
    const auto estimate = EstimateCameras({.photographs = folder / "p",
                                           .scene_folder = scene,
                                           .threads = 1 + 2 * i,
                                           .max_features = 800,
                                           .max_image_size = 500},
                                          RealClock(), [](const CameraProgress&) {});
    ASSERT_TRUE(estimate.ok()) << estimate.status();
    EXPECT_GE(estimate->registered, 5);
    for (const char* file : {"cameras", "images", "points3D"})
      models[i] += *ReadFile(scene + "/sparse/0/" + file + ".bin");
  }
  EXPECT_EQ(models[0], models[1]);
}

}  // namespace
}  // namespace meshwright
