// SPDX-License-Identifier: Apache-2.0
#include "pipeline/options/presets.h"

#include <algorithm>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include "common/base/check.h"

namespace meshwright {
namespace {

constexpr size_t kMostShown = 40;  // characters of what the user wrote

std::vector<Preset> MakePresets() {
  return {
      {"draft",
       "is everything seen, are the cameras right: a coarse surface from small photographs",
       {{"max-image-size", int64_t{1200}}, {"lattice-step", int64_t{3}}, {"max-targets", int64_t{5}}}},
      {"normal", "what the options are by themselves", {}},
      {"fine", "every pixel of the photographs is a ray, four times as many vertices", {{"lattice-step", int64_t{1}}}},
  };
}

}  // namespace

const std::vector<Preset>& Presets() {
  static const auto* const presets = new std::vector<Preset>(MakePresets());
  return *presets;
}

absl::Status ApplyPreset(const std::string& name, const std::string& prefix, ReconstructionOptions& options) {
  const auto found = std::ranges::find_if(Presets(), [&](const Preset& preset) { return preset.name == name; });
  if (found == Presets().end()) {
    std::vector<std::string> names;
    for (const Preset& preset : Presets()) names.emplace_back(preset.name);
    return absl::InvalidArgumentError(absl::StrCat(prefix, kPreset, " is ", name.substr(0, kMostShown),
                                                   ", expected one of ", absl::StrJoin(names, ", ")));
  }
  options = {};
  for (const auto& [option, value] : found->values) {
    const Option* const set = FindOption(option);
    MW_CHECK(set != nullptr);
    set->Set(options, value);
  }
  return absl::OkStatus();
}

std::string DescribeValues(const Preset& preset) {
  if (preset.values.empty()) return "the defaults";
  return absl::StrJoin(preset.values, ", ", [](std::string* text, const auto& value) {
    absl::StrAppend(text, value.first, " ", FormatValue(value.second));
  });
}

}  // namespace meshwright
