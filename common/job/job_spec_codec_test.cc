// SPDX-License-Identifier: Apache-2.0
#include "common/job/job_spec_codec.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace meshwright {
namespace {

TEST(JobSpecCodecTest, WhatIsEncodedComesBack) {
  const StoredJobSpec spec = {.targets = {3, 1},
                              .accepted = {{.sequence = 2, .camera = 9, .digest = "d", .patches = 1'000'000'000'000}},
                              .memory_bytes = {5'000'000'000, 7}};
  const auto decoded = DecodeJobSpec(EncodeJobSpec(spec));
  ASSERT_TRUE(decoded.ok()) << decoded.status();
  EXPECT_EQ(decoded->targets, spec.targets);
  EXPECT_EQ(decoded->memory_bytes, spec.memory_bytes);
  ASSERT_EQ(decoded->accepted.size(), 1);
  EXPECT_EQ(decoded->accepted[0].sequence, 2);
  EXPECT_EQ(decoded->accepted[0].camera, 9);
  EXPECT_EQ(decoded->accepted[0].digest, "d");
  EXPECT_EQ(decoded->accepted[0].patches, 1'000'000'000'000);
}

TEST(JobSpecCodecTest, DamageIsDataLoss) {
  for (const char* text : {"", "{", "[]", "{}", R"({"targets":1,"accepted":[],"memory_bytes":[]})",
                           R"({"targets":[],"accepted":[[1]],"memory_bytes":[]})"}) {
    EXPECT_TRUE(absl::IsDataLoss(DecodeJobSpec(text).status())) << text;
  }
}

TEST(JobSpecCodec, PhotographsComeBackAndNothingElseDoes) {
  const std::vector<StoredPhotograph> photographs = {{"a 1.jpg", "aa"}, {"masks/a 1.jpg.png", "bb"}};
  EXPECT_EQ(*DecodePhotographs(EncodePhotographs(photographs)), photographs);
  for (const char* text : {"", "{}", R"({"photographs": [["a"]]})", R"({"photographs": [[1, 2]]})"}) {
    EXPECT_TRUE(absl::IsDataLoss(DecodePhotographs(text).status())) << text;
  }
}

}  // namespace
}  // namespace meshwright
