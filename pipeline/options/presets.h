// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <utility>
#include <vector>

#include <absl/status/status.h>

#include "pipeline/options/option_table.h"

namespace meshwright {

// The name of what chooses a preset: --preset on the command line, "preset" in JSON. It is no option of its own: what
// it stands for is written out wherever options are kept.
constexpr char kPreset[] = "preset";

// Values of options that go together; an option that is said by itself wins.
struct Preset {
  const char* name;
  const char* help;
  std::vector<std::pair<const char*, OptionValue>> values;  // option, value; all others have their defaults
};

// From the quickest to the finest.
const std::vector<Preset>& Presets();

// All options as the preset has them. InvalidArgument: "--preset is quick, expected one of draft, normal, fine";
// `prefix` is
// "--" or "".
absl::Status ApplyPreset(const std::string& name, const std::string& prefix, ReconstructionOptions& options);

// "lattice-step 4, max-targets 4"; "the defaults".
std::string DescribeValues(const Preset& preset);

}  // namespace meshwright
