// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "pipeline/options/reconstruction_options.h"

namespace meshwright {

// A whole or a real number; which of them is the option's type.
using OptionValue = std::variant<int64_t, double>;

// An option as it is declared, once: the command line, the help, the JSON of REST and gRPC, the page docs/options.md,
// the dashboard's form and all messages are made from it.
struct Option {
  const char* name;     // "lattice-step"; --lattice-step on the command line
  const char* section;  // what it belongs to, with the section of Jancosek et al. 2009
  const char* unit;     // "px", "degrees"; "" for counts and ratios
  double minimum;       // both are allowed; every value between them is safe to compute with, whatever the
  double maximum;       // other options are
  const char* help;     // what it is
  const char* trade_off;
  std::variant<int& (*)(ReconstructionOptions&), int64_t& (*)(ReconstructionOptions&),
               double& (*)(ReconstructionOptions&)>
      field;

  bool is_integer() const { return field.index() < 2; }
  OptionValue Get(const ReconstructionOptions& options) const;
  // The value has to be within the bounds and of the option's type.
  void Set(ReconstructionOptions& options, OptionValue value) const;
  OptionValue Default() const { return Get(ReconstructionOptions()); }
};

// All of them, in the order of the documentation.
const std::vector<Option>& OptionTable();
// nullptr: there is none of this name.
const Option* FindOption(const std::string& name);
// "there is no option --windw, did you mean --window?"; `prefix` is "--" or "".
std::string DescribeUnknownOption(const std::string& name, const std::string& prefix);

// factor * smaller + offset <= larger, for the values of two options.
struct OptionRelation {
  const char* smaller;
  const char* larger;
  int factor;
  int offset;
};
const std::vector<OptionRelation>& OptionRelations();

// "2", "0.4".
std::string FormatValue(OptionValue value);
// "1 to 16 px".
std::string DescribeRange(const Option& option);

// Messages name the option as the user wrote it: `prefix` is "--" for the command line, "" for JSON. InvalidArgument:
// "--support is 0, expected a whole number from 1 to 255".
absl::StatusOr<OptionValue> ParseOptionText(const Option& option, const std::string& text, const std::string& prefix);
absl::StatusOr<OptionValue> CheckOptionValue(const Option& option, OptionValue value, const std::string& text,
                                             const std::string& prefix);
// All bounds and relations.
absl::Status CheckOptions(const ReconstructionOptions& options, const std::string& prefix);

}  // namespace meshwright
