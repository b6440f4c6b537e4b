// SPDX-License-Identifier: Apache-2.0
#include "coordinator/nodeodm/odm_options.h"

#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace meshwright {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr char kOwn[] = R"({"options": [
  {"name": "max-image-size", "type": "integer", "unit": "px", "default": 0, "minimum": 0.0, "maximum": 100000.0,
   "documentation": "longest side", "tradeOff": "", "group": "x"},
  {"name": "weight", "type": "number", "unit": "", "default": 0.5, "minimum": 0.0, "maximum": 1.0,
   "documentation": "of something", "tradeOff": "", "group": "x"}]})";

TEST(OdmOptionsTest, AreDescribedByFiveKeysOfText) {
  const OdmOptions options(kOwn);
  std::set<std::string> names;
  for (const auto& item : nlohmann::json::parse(options.description())) {
    std::set<std::string> keys;
    for (const auto& [key, value] : item.items()) {
      keys.insert(key);
      EXPECT_TRUE(value.is_string() || (key == "domain" && item["type"] == "enum")) << item;
    }
    EXPECT_EQ(keys, (std::set<std::string>{"name", "type", "value", "domain", "help"})) << item;
    names.insert(item["name"].get<std::string>());
  }
  EXPECT_EQ(names.count("pc-quality") + names.count("max-image-size") + names.count("weight"), 3U);
  EXPECT_THAT(options.description(), HasSubstr("integer: 0 <= x <= 100000"));
  EXPECT_THAT(options.description(), HasSubstr("float: 0 <= x <= 1"));
}

TEST(OdmOptionsTest, OursAreTakenAsNumbersOrTextAndOthersAreNamed) {
  const auto options = OdmOptions(kOwn).Parse(
      R"([{"name": "weight", "value": "0.25"}, {"name": "max-image-size", "value": 800}, {"name": "dsm", "value": true},
          {"name": "name", "value": "x"}, {"name": "skip-3dmodel", "value": true}])");
  ASSERT_TRUE(options.ok()) << options.status();
  EXPECT_EQ(options->own, nlohmann::json::parse(R"({"weight": 0.25, "max-image-size": 800})"));
  EXPECT_THAT(options->unused, ElementsAre("dsm"));
  EXPECT_TRUE(options->skips_model);
  EXPECT_EQ(options->given.size(), 5U);
  EXPECT_TRUE(OdmOptions(kOwn).Parse("")->given.empty());
}

TEST(OdmOptionsTest, QualityIsAShareOfThePhotographsSize) {
  const OdmOptions options(kOwn);
  const auto size_of = [&](const std::string& json) {
    const auto parsed = options.Parse(json);
    return parsed.ok() ? OwnOptionsJson(*parsed, 4000) : std::string(parsed.status().message());
  };
  EXPECT_EQ(size_of("[]"), "{}");
  EXPECT_EQ(size_of(R"([{"name": "pc-quality", "value": "ultra"}])"), "{}");
  EXPECT_EQ(size_of(R"([{"name": "pc-quality", "value": "high"}])"), R"({"max-image-size":2000})");
  EXPECT_EQ(size_of(R"([{"name": "pc-quality", "value": "high"}, {"name": "feature-quality", "value": "low"}])"),
            R"({"max-image-size":500})");
  EXPECT_EQ(size_of(R"([{"name": "pc-quality", "value": "low"}, {"name": "max-image-size", "value": 1600}])"),
            R"({"max-image-size":1600})");
}

TEST(OdmOptionsTest, AllBadValuesAreNamed) {
  const OdmOptions options(kOwn);
  const auto refused = options.Parse(
      R"([{"name": "weight", "value": 2}, {"name": "max-image-size", "value": "1.5"}, {"name": "pc-quality", "value": "best"},
          {"name": "skip-3dmodel", "value": "yes"}])");
  ASSERT_TRUE(absl::IsInvalidArgument(refused.status()));
  const auto errors = nlohmann::json::parse(std::string(refused.status().message()));
  ASSERT_EQ(errors.size(), 4U);
  EXPECT_EQ(errors[0]["name"], "weight");
  EXPECT_THAT(errors[0]["error"].get<std::string>(), HasSubstr("Invalid value 2"));
  for (const char* json :
       {"{", "{}", "[1]", R"([{"name": 1, "value": 2}])", R"([{"name": "x"}])", "[[[[[[[[[[[]]]]]]]]]]]"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(options.Parse(json).status())) << json;
  }
}

}  // namespace
}  // namespace meshwright
