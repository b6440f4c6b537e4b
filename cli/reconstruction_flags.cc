#include "cli/reconstruction_flags.h"

#include <string>

#include <absl/strings/str_cat.h>

#include "pipeline/options/option_table.h"

namespace meshwright {

void AddReconstructionFlags(CLI::App& command, ReconstructionOptions& options) {
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
// SPDX-License-Identifier: Apache-2.0
