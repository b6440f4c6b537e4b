// SPDX-License-Identifier: Apache-2.0
#include "common/base/nearest_name.h"

#include <gtest/gtest.h>

namespace meshwright {
namespace {

const std::vector<std::string> kNames = {"window", "support", "support-radius", "api-token-file", "blend"};

TEST(NearestNameTest, OneSlipIsForgiven) {
  for (const char* word : {"windw", "windoww", "wnidow", "windou", "window"}) {
    EXPECT_EQ(NearestName(word, kNames), "window") << word;
  }
  EXPECT_EQ(NearestName("api-token-fiel", kNames), "api-token-file");
  EXPECT_EQ(NearestName("api_token_file", kNames), "api-token-file");
  EXPECT_EQ(NearestName("suport-radius", kNames), "support-radius");
}

TEST(NearestNameTest, AnotherWordIsNot) {
  for (const char* word : {"", "x", "threads", "widen", "bl"}) EXPECT_EQ(NearestName(word, kNames), "") << word;
  EXPECT_EQ(NearestName(std::string(1'000'000, 'w'), kNames), "");
  EXPECT_EQ(NearestName("window", {}), "");
}

TEST(NearestNameTest, TheSentence) {
  EXPECT_EQ(DidYouMean("blnd", kNames, "--"), ", did you mean --blend?");
  EXPECT_EQ(DidYouMean("nonsense", kNames, "--"), "");
}

}  // namespace
}  // namespace meshwright
