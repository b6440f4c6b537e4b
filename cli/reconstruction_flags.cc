// SPDX-License-Identifier: Apache-2.0
#include "cli/reconstruction_flags.h"

#include <string>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include "pipeline/options/option_table.h"
#include "pipeline/options/presets.h"

namespace meshwright {

namespace {

// First of all options: CLI11 reads them in the order in which they were added, and what is said by itself wins
// wherever on the line it stands.
void AddPresetFlag(CLI::App& command, ReconstructionOptions& options) {
  const auto set = [&options](const std::string& name) {
    const absl::Status applied = ApplyPreset(name, "--", options);
    if (!applied.ok()) throw CLI::ParseError(std::string(applied.message()), CLI::ExitCodes::ValidationError);
  };
  const std::string presets = absl::StrJoin(Presets(), "; ", [](std::string* text, const Preset& preset) {
    absl::StrAppend(text, preset.name, ": ", preset.help, " (", DescribeValues(preset), ")");
  });
  command
      .add_option_function<std::string>(absl::StrCat("--", kPreset), set,
                                        absl::StrCat(presets, ". Options that are given by themselves win"))
      ->type_name("NAME")
      ->default_str("normal")
      ->group(OptionTable().front().section);
}

}  // namespace

void AddReconstructionFlags(CLI::App& command, ReconstructionOptions& options) {
  AddPresetFlag(command, options);
  for (const Option& option : OptionTable()) {
    const auto set = [&option, &options](const std::string& text) {
      const absl::StatusOr<OptionValue> value = ParseOptionText(option, text, "--");
      if (!value.ok()) throw CLI::ParseError(std::string(value.status().message()), CLI::ExitCodes::ValidationError);
      option.Set(options, *value);
    };
    command
        .add_option_function<std::string>(
            absl::StrCat("--", option.name), set,
            absl::StrCat(option.help, " [", DescribeRange(option), "]; ", option.trade_off))
        ->type_name(option.is_integer() ? "INT" : "FLOAT")
        ->default_str(FormatValue(option.Default()))
        ->group(option.section);
  }
}

}  // namespace meshwright
