// SPDX-License-Identifier: Apache-2.0
#include "common/json/parse_json.h"

#include <cstdint>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/json/whole_number.h"

namespace meshwright {
namespace {

using testing::HasSubstr;

std::string Nested(int levels) {
  return std::string(static_cast<size_t>(levels), '[') + std::string(static_cast<size_t>(levels), ']');
}

std::string Refusal(const std::string& text, const JsonLimits& limits = {}) {
  const auto json = ParseJson(text, limits);
  EXPECT_TRUE(absl::IsInvalidArgument(json.status())) << text.substr(0, 40);
  return std::string(json.status().message());
}

TEST(ParseJsonTest, DepthIsLimited) {
  EXPECT_TRUE(ParseJson(Nested(8)).ok());
  EXPECT_EQ(Refusal(Nested(9)), "is nested 9 levels deep, expected at most 8");
  EXPECT_TRUE(ParseJson(Nested(9), {.max_depth = 9}).ok());
  EXPECT_TRUE(ParseJson("[[],[],[],[],[],[],[],[],[],[],[]]").ok());
  EXPECT_TRUE(ParseJson("3", {.max_depth = 0}).ok());
  EXPECT_THAT(Refusal(std::string(60'000, '['), {.max_bytes = 1 << 20}), HasSubstr("60000 levels"));
  std::string objects;
  for (int i = 0; i < 10'000; ++i) objects += "{\"a\":";
  EXPECT_THAT(Refusal(objects), HasSubstr("10000 levels"));
}

TEST(ParseJsonTest, BracketsInStringsAreNoLevels) {
  EXPECT_TRUE(ParseJson(R"(["[[[[[[[[[[[[[[{{{{{{{{{{{{"])").ok());
  EXPECT_TRUE(ParseJson(R"(["\"[[[[[[[[[[[[", "\\"])").ok());
  // The string ends before the brackets begin.
  EXPECT_THAT(Refusal(R"("\\")" + Nested(9)), HasSubstr("9 levels"));
}

TEST(ParseJsonTest, SizeIsLimited) {
  const std::string limit = "\"" + std::string((size_t{64} << 10) - 2, 'x') + "\"";
  EXPECT_TRUE(ParseJson(limit).ok());
  EXPECT_EQ(Refusal(limit + " "), "has 65537 bytes, expected at most 65536");
}

TEST(ParseJsonTest, WhatIsNoJsonIsRefused) {
  for (const char* text : {"", "{", "{\"a\":}", "nan", "[1,]", "\"\xff\"", "1e999", "{} x", "\"", "[\"\\"}) {
    EXPECT_EQ(Refusal(text), "is not valid JSON") << text;
  }
}

TEST(WholeNumber, IsOneOfItsTypeOrAnError) {
  EXPECT_EQ(WholeNumber<int>(*ParseJson("-7")).value(), -7);
  EXPECT_EQ(WholeNumber<int64_t>(*ParseJson("9223372036854775807")).value(), INT64_MAX);
  EXPECT_EQ(WholeNumber<uint8_t>(*ParseJson("255")).value(), 255);
  for (const char* text :
       {"1e99", "1.0", "2147483648", "-2147483649", "18446744073709551615", "null", "\"1\"", "true"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(WholeNumber<int>(*ParseJson(text)).status())) << text;
  }
  EXPECT_FALSE(WholeNumber<uint8_t>(*ParseJson("-1")).ok());
  EXPECT_FALSE(WholeNumber<int64_t>(*ParseJson("9223372036854775808")).ok());
}

}  // namespace
}  // namespace meshwright
