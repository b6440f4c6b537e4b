// SPDX-License-Identifier: Apache-2.0
#include "pipeline/cameras/colmap_output.h"

#include <gtest/gtest.h>

namespace meshwright {
namespace {

TEST(ColmapOutput, CountsAreThoseOfTheStep) {
  ColmapOutput features(CameraStep::kFeatures, 25);
  EXPECT_TRUE(features.Read("Processed file [3/25]"));
  EXPECT_EQ(features.done(), 3);
  EXPECT_EQ(features.total(), 25);
  EXPECT_FALSE(features.Read("  Features:        3079"));

  ColmapOutput verifying(CameraStep::kVerifying, 25);
  EXPECT_TRUE(verifying.Read("I0910 16:59:24 1 feature_matching.cc:9] Matching block [9/25] in 0.1s"));
  EXPECT_EQ(verifying.done(), 9);
}

TEST(ColmapOutput, ASecondModelDoesNotSetTheBarBack) {
  ColmapOutput mapping(CameraStep::kMapping, 4);
  EXPECT_TRUE(mapping.Read("Registering image #17 (3)"));
  EXPECT_FALSE(mapping.Read("Registering image #18 (2)"));
  EXPECT_EQ(mapping.done(), 3);
  EXPECT_TRUE(mapping.Read("Registering image #18 (99)"));
  EXPECT_EQ(mapping.done(), 4);
}

TEST(ColmapOutput, NonsenseCountsNothing) {
  for (const char* line : {"Processed file [0/25]", "Processed file [7/3]", "Processed file [-1/25]",
                           "Processed file [", "Processed file [99999999999999999999/1]", "Registering image #", ""}) {
    for (const auto step : {CameraStep::kFeatures, CameraStep::kVerifying, CameraStep::kMapping}) {
      ColmapOutput output(step, 25);
      EXPECT_FALSE(output.Read(line)) << line;
      EXPECT_EQ(output.done(), 0);
    }
  }
}

TEST(ColmapOutput, KeepsTheLastTrouble) {
  ColmapOutput output(CameraStep::kMapping, 4);
  output.Read("ERROR: one");
  output.Read("F0101 x.cc:1] Check failed: two");
  output.Read("fine");
  EXPECT_EQ(output.trouble(), "F0101 x.cc:1] Check failed: two");
}

}  // namespace
}  // namespace meshwright
