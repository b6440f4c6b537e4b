// SPDX-License-Identifier: Apache-2.0
#include "pipeline/options/presets.h"

#include <set>
#include <string>

#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pipeline/options/option_testing.h"
#include "pipeline/options/options_json.h"

namespace meshwright {
namespace {

using testing::HasSubstr;

std::string JsonOf(const Preset& preset, const std::string& more = "") {
  return absl::StrCat("{\"preset\": \"", preset.name, "\"", more, "}");
}

TEST(PresetsTest, EachIsAllowedAndSetsWhatItSaysAndNothingElse) {
  std::set<std::string> names;
  for (const Preset& preset : Presets()) {
    EXPECT_TRUE(names.insert(preset.name).second);
    ReconstructionOptions options;
    options.conductor.window = 99;  // whatever stood there before
    ASSERT_TRUE(ApplyPreset(preset.name, "--", options).ok());
    EXPECT_TRUE(options.Validate().ok()) << options.Validate();
    std::set<std::string> changed;
    for (const Option& option : OptionTable()) {
      if (option.Get(options) != option.Default()) changed.insert(option.name);
    }
    std::set<std::string> said;
    for (const auto& [name, value] : preset.values) {
      ASSERT_NE(FindOption(name), nullptr) << name;
      EXPECT_EQ(FindOption(name)->Get(options), value) << name;
      said.insert(name);
    }
    EXPECT_EQ(changed, said) << preset.name;
  }
}

// A preset that decides nothing would be a name for nothing.
TEST(PresetsTest, TheyDifferFromEachOther) {
  std::set<std::string> meanings;
  for (const Preset& preset : Presets()) EXPECT_TRUE(meanings.insert(DescribeValues(preset)).second) << preset.name;
}

TEST(PresetsTest, WhatIsSaidByItselfWins) {
  for (const Preset& preset : Presets()) {
    for (const Option& option : OptionTable()) {
      const std::string said = JsonWithValue(option, option.maximum);
      const std::string more = ", " + said.substr(1, said.size() - 2);
      const auto options = ParseOptions(JsonOf(preset, more));
      ASSERT_TRUE(options.ok()) << options.status();
      EXPECT_EQ(option.Get(*options), Bound(option, option.maximum)) << preset.name << " " << option.name;
    }
  }
}

// A mesh of a preset and a mesh of its values are the same mesh, also to a work folder and to a service.
TEST(PresetsTest, APresetIsWrittenOutAsItsValues) {
  for (const Preset& preset : Presets()) {
    ReconstructionOptions options;
    ASSERT_TRUE(ApplyPreset(preset.name, "", options).ok());
    EXPECT_EQ(ToJson(*ParseOptions(JsonOf(preset))), ToJson(options));
    EXPECT_FALSE(ToJson(options).contains(kPreset));
  }
}

TEST(PresetsTest, AnUnknownOneIsNamedWithThoseThatThereAre) {
  ReconstructionOptions options;
  const std::string expected = "preset is quick, expected one of draft, normal, fine";
  EXPECT_EQ(std::string(ApplyPreset("quick", "--", options).message()), "--" + expected);
  EXPECT_EQ(std::string(ParseOptions(R"({"preset": "quick"})").status().message()), "options_json: " + expected);
  for (const char* const no_name : {"1", "null", "[]", "{}", "\"\""}) {
    EXPECT_THAT(std::string(ParseOptions(absl::StrCat("{\"preset\": ", no_name, "}")).status().message()),
                HasSubstr("expected one of draft"));
  }
}

TEST(PresetsTest, RestNamesThem) {
  const auto list = nlohmann::json::parse(DescribeOptionsForRest())["presets"];
  ASSERT_EQ(list.size(), Presets().size());
  for (size_t i = 0; i < list.size(); ++i) {
    EXPECT_EQ(list[i]["name"], Presets()[i].name);
    EXPECT_EQ(list[i]["values"].size(), Presets()[i].values.size());
    // What a client sends instead of the name means the same.
    EXPECT_EQ(ToJson(*ParseOptions(list[i]["values"].dump())), ToJson(*ParseOptions(JsonOf(Presets()[i]))));
  }
}

}  // namespace
}  // namespace meshwright
