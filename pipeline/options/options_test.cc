// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>
#include <set>
#include <string>

#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pipeline/options/option_table.h"
#include "pipeline/options/option_testing.h"
#include "pipeline/options/options_json.h"

#include "common/base/method_version.h"

namespace meshwright {
namespace {

using testing::HasSubstr;

std::string Refusal(const std::string& options_json) {
  const auto options = ParseOptions(options_json);
  EXPECT_TRUE(absl::IsInvalidArgument(options.status())) << options_json.substr(0, 80);
  return std::string(options.status().message());
}

TEST(OptionTableTest, EveryOptionIsDeclaredInFull) {
  std::set<std::string> names;
  for (const Option& option : OptionTable()) {
    EXPECT_TRUE(names.insert(option.name).second) << option.name;
    EXPECT_EQ(FindOption(option.name), &option);
    EXPECT_STRNE(option.section, "") << option.name;
    EXPECT_STRNE(option.help, "") << option.name;
    EXPECT_STRNE(option.trade_off, "") << option.name;
    EXPECT_TRUE(std::isfinite(option.minimum) && std::isfinite(option.maximum)) << option.name;
    EXPECT_LT(option.minimum, option.maximum) << option.name;
  }
  EXPECT_TRUE(ReconstructionOptions().Validate().ok()) << ReconstructionOptions().Validate();
}

// Two options of one field would pass all other tests.
TEST(OptionTableTest, EveryOptionSetsItselfAlone) {
  for (const Option& option : OptionTable()) {
    ReconstructionOptions options;
    const OptionValue value =
        Bound(option, option.Default() == Bound(option, option.maximum) ? option.minimum : option.maximum);
    option.Set(options, value);
    for (const Option& other : OptionTable()) {
      EXPECT_EQ(other.Get(options), &other == &option ? value : other.Default()) << option.name << ", " << other.name;
    }
  }
}

TEST(OptionTableTest, BoundsAreWhatTheAlgorithmTakes) {
  for (const Option& option : OptionTable()) {
    for (const double bound : {option.minimum, option.maximum}) {
      const ReconstructionOptions options = WithValue(option, bound);
      EXPECT_TRUE(options.Validate().ok()) << option.name << ": " << options.Validate();
    }
  }
}

TEST(OptionTableTest, EveryBoundIsAcceptedAndWhatIsBeyondIsNamed) {
  for (const Option& option : OptionTable()) {
    for (const double bound : {option.minimum, option.maximum}) {
      const std::string text = FormatValue(Bound(option, bound));
      for (const char* prefix : {"--", ""}) {
        const auto value = ParseOptionText(option, text, prefix);
        ASSERT_TRUE(value.ok()) << value.status();
        EXPECT_EQ(*value, Bound(option, bound));
      }
      EXPECT_TRUE(ParseOptions(JsonWithValue(option, bound)).ok())
          << option.name << ParseOptions(JsonWithValue(option, bound)).status();
    }
    for (const std::string& text : RefusedTexts(option)) {
      const std::string expected =
          absl::StrCat(option.name, " is ", text.substr(0, 40), ", expected a ",
                       option.is_integer() ? "whole number" : "number", " from ", DescribeRange(option));
      for (const char* prefix : {"--", ""}) {
        const auto value = ParseOptionText(option, text, prefix);
        EXPECT_EQ(std::string(value.status().message()), prefix + expected);
      }
      if (!IsJsonNumber(text)) continue;
      EXPECT_EQ(Refusal(absl::StrCat("{\"", option.name, "\":", text, "}")), "options_json: " + expected);
    }
    for (const char* json : {"\"4\"", "null", "true", "[]", "{}", "[[[[1]]]]"}) {
      EXPECT_THAT(Refusal(absl::StrCat("{\"", option.name, "\":", json, "}")),
                  HasSubstr(absl::StrCat(option.name, " is ", json, ", expected a ")))
          << json;
    }
  }
}

TEST(OptionTableTest, OptionsThatBoundEachOtherAreBothNamed) {
  EXPECT_EQ(Refusal(R"({"mrf-window":64})"),
            "options_json: mrf-window is 64, expected at least 2 * mrf-margin (50) + 2 = 102");
  EXPECT_EQ(Refusal(R"({"min-pair-angle":60})"),
            "options_json: max-pair-angle is 50, expected at least min-pair-angle (60)");
  EXPECT_TRUE(ParseOptions(R"({"mrf-window":64, "mrf-margin":31})").ok());
  ReconstructionOptions options;
  options.conductor.pairs.min_angle_deg = 51;
  EXPECT_THAT(std::string(CheckOptions(options, "--").message()), HasSubstr("--min-pair-angle (51)"));
}

TEST(OptionTableTest, AValueThatIsNoNumberIsNoOption) {
  ReconstructionOptions options;
  options.job.growing.min_quality = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(std::string(options.Validate().message()), "min-quality is nan, expected a number from -1 to 1");
}

TEST(ParseOptionsTest, WhatIsNotSaidHasItsDefault) {
  const nlohmann::ordered_json defaults = ToJson(ReconstructionOptions());
  EXPECT_EQ(ToJson(*ParseOptions("")), defaults);
  EXPECT_EQ(ToJson(*ParseOptions("{}")), defaults);
  EXPECT_EQ(ToJson(*ParseOptions(defaults.dump())), defaults);
  EXPECT_EQ(defaults.size(), OptionTable().size() + 1);  // and the method
  // What programs wrote before the method had a version is of its first.
  EXPECT_THAT(Refusal(R"({"version": "0.1.0"})"), HasSubstr("method is 1, this program has version"));
  EXPECT_EQ(ParseOptions(R"({"window": 7})")->conductor.window, 7);
  EXPECT_EQ(ParseOptions(R"({"max-hole": 7})")->join.max_hole_steps, 7);
}

TEST(ParseOptionsTest, AnUnknownOptionIsNamedWithTheNearest) {
  EXPECT_EQ(Refusal(R"({"windw": 1})"), "options_json: there is no option \"windw\", did you mean window?");
  EXPECT_EQ(Refusal(R"({"k_a": 1})"), "options_json: there is no option \"k_a\"");
  EXPECT_EQ(DescribeUnknownOption("suport", "--"), "there is no option \"--suport\", did you mean --support?");
}

TEST(ParseOptionsTest, TextsThatAreNoOptionsAreRefused) {
  EXPECT_THAT(Refusal("[]"), HasSubstr("a JSON object expected"));
  EXPECT_THAT(Refusal("{"), HasSubstr("the text is not valid JSON"));
  EXPECT_THAT(Refusal(R"({"version": "7"})"), HasSubstr("version is \"7\""));
  for (const std::string& method : {absl::StrCat(kMethodVersion + 1), std::string("0"), std::string("\"1\""),
                                    std::string("1.5"), std::string("[]")}) {
    EXPECT_THAT(Refusal(absl::StrCat("{\"method\": ", method, "}")), HasSubstr(absl::StrCat("method is ", method)));
  }
  EXPECT_THAT(Refusal(R"({"window": 99999999999999999999})"), HasSubstr("expected a whole number from 1 to"));
}

TEST(ParseOptionsTest, DeepAndLongTextsAreRefused) {
  for (const std::string& open : {std::string("["), std::string("{\"a\":")}) {
    std::string deep = "{\"window\":";
    for (int i = 0; i < 12'000; ++i) deep += open;
    EXPECT_THAT(Refusal(deep), HasSubstr("levels deep, expected at most 8")) << open;
  }
  EXPECT_THAT(Refusal("{\"window\":" + std::string(60'000, '[') + std::string(60'000, ']') + "}"),
              HasSubstr("expected at most 65536"));
}

TEST(DescribeDifferencesTest, OneLineForEachOption) {
  ReconstructionOptions other;
  other.conductor.window = 1;
  const auto now = ToJson(ReconstructionOptions());
  EXPECT_TRUE(DescribeDifferences(now, now).empty());
  EXPECT_THAT(DescribeDifferences(ToJson(other), now), testing::ElementsAre("--window was 1, now 4"));
}

TEST(DescribeOptionsForRestTest, ItSaysWhatIsDeclared) {
  const auto list = nlohmann::json::parse(DescribeOptionsForRest())["options"];
  ASSERT_EQ(list.size(), OptionTable().size());
  const nlohmann::json expected = {{"name", "lattice-step"},
                                   {"group", "Reconstruction"},
                                   {"type", "integer"},
                                   {"unit", "px"},
                                   {"default", 2},
                                   {"minimum", 1},
                                   {"maximum", 16},
                                   {"documentation", OptionTable()[1].help},
                                   {"tradeOff", OptionTable()[1].trade_off}};
  EXPECT_EQ(list[1], expected);
}

}  // namespace
}  // namespace meshwright
