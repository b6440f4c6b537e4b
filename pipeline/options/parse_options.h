#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "pipeline/options/reconstruction_options.h"

namespace meshwright {

// Options as users write them: a JSON object with names of VisitOptions, any of them left out. "" stands for {}.
// InvalidArgument names the option, its value and what was expected.
absl::StatusOr<ReconstructionOptions> ParseOptions(const std::string& options_json);

}  // namespace meshwright
