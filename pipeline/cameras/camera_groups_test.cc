// SPDX-License-Identifier: Apache-2.0
#include "pipeline/cameras/camera_groups.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace meshwright {
namespace {

Photograph Taken(const std::string& name, int width, int height, double focal_35mm = 0) {
  return {.name = name,
          .path = "",
          .mask_path = "",
          .size = {.width = width, .height = height},
          .exif = {.make = "M", .model = "1", .lens = "", .focal_mm = 0, .focal_35mm = focal_35mm}};
}

TEST(CameraGroups, OneCameraOneZoomOneSizeOneFolderIsOneGroup) {
  const std::vector<CameraGroup> groups =
      GroupByCamera({Taken("a.jpg", 400, 300), Taken("b.jpg", 400, 300), Taken("c.jpg", 300, 400),
                     Taken("d.jpg", 400, 300, 28), Taken("left/e.jpg", 400, 300), Taken("f.jpg", 400, 300)});
  ASSERT_EQ(groups.size(), 4U);
  EXPECT_THAT(groups[0].photographs, testing::ElementsAre(0, 1, 5));
  EXPECT_THAT(groups[1].photographs, testing::ElementsAre(2));
  EXPECT_THAT(groups[2].photographs, testing::ElementsAre(3));
  EXPECT_THAT(groups[3].photographs, testing::ElementsAre(4));
}

TEST(CameraGroups, FocalLengthFollowsTheDiagonalOfFilm) {
  const std::vector<CameraGroup> groups = GroupByCamera({Taken("a.jpg", 4000, 3000, 28), Taken("b.jpg", 4000, 3000)});
  EXPECT_TRUE(groups[0].focal_from_exif);
  EXPECT_NEAR(groups[0].focal_px, 28 * 5000 / 43.27, 1e-9);
  EXPECT_FALSE(groups[1].focal_from_exif);
  EXPECT_DOUBLE_EQ(groups[1].focal_px, 4800);
}

TEST(CameraGroups, FewPhotographsDoNotDetermineManyCoefficients) {
  std::vector<Photograph> photographs;
  for (int i = 0; i < 4; ++i) photographs.push_back(Taken(std::to_string(i), 40, 30));
  EXPECT_FALSE(GroupByCamera(photographs)[0].wide_model);
  photographs.push_back(Taken("4", 40, 30));
  EXPECT_TRUE(GroupByCamera(photographs)[0].wide_model);
}

}  // namespace
}  // namespace meshwright
