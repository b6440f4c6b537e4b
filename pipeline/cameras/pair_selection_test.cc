// SPDX-License-Identifier: Apache-2.0
#include "pipeline/cameras/pair_selection.h"

#include <absl/strings/str_format.h>
#include <gtest/gtest.h>

namespace meshwright {
namespace {

std::vector<Photograph> Named(const char* format, int count, int stride, const std::string& make = "") {
  std::vector<Photograph> photographs;
  for (int i = 0; i < count; ++i) {
    photographs.push_back({.name = absl::StrFormat(*absl::ParsedFormat<'d'>::New(format), i * stride),
                           .path = "",
                           .mask_path = "",
                           .size = {.width = 40, .height = 30},
                           .exif = {.make = make, .model = "", .lens = ""}});
  }
  return photographs;
}

TEST(PairSelection, FewAreComparedEachWithEach) {
  EXPECT_EQ(ChoosePairs(Named("frame-%05d.jpg", 200, 1)).selection, PairSelection::kExhaustive);
}

TEST(PairSelection, FramesOfAVideoAreComparedWithThoseThatFollow) {
  EXPECT_EQ(ChoosePairs(Named("frame-%05d.jpg", 201, 15)).selection, PairSelection::kSequential);
}

TEST(PairSelection, NumberedPhotographsOfACameraAreNoVideo) {
  EXPECT_EQ(ChoosePairs(Named("IMG_%04d.jpg", 201, 1, "Maker")).selection, PairSelection::kSimilar);
  EXPECT_EQ(ChoosePairs(Named("%d-photo.jpg", 201, 1)).selection, PairSelection::kSimilar);
  EXPECT_EQ(ChoosePairs(Named("frame-%09d.jpg", 201, 1000)).selection, PairSelection::kSimilar);
}

TEST(PairSelection, PairsByNumber) {
  EXPECT_EQ(PairsByNumber(PairSelection::kExhaustive, 3), std::vector<ImagePair>({{1, 2}, {1, 3}, {2, 3}}));
  EXPECT_EQ(PairsByNumber(PairSelection::kSequential, 30).size(), 20U * 10 + 45);
  EXPECT_TRUE(PairsByNumber(PairSelection::kSimilar, 30).empty());
}

TEST(PairSelection, NamesComeBack) {
  for (const auto selection : {PairSelection::kExhaustive, PairSelection::kSequential, PairSelection::kSimilar}) {
    EXPECT_EQ(PairSelectionOfName(NameOf(selection)), selection);
  }
  EXPECT_EQ(PairSelectionOfName("auto"), std::nullopt);
}

}  // namespace
}  // namespace meshwright
