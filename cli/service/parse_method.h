#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "cli/local/reconstruction_options.h"
#include "coordinator/api/method.h"
#include "worker/agent/job_contexts.h"

namespace meshwright {

// Options as users write them: a JSON object with names of VisitOptions, any of them left out. "" stands for {}.
// InvalidArgument names the option, its value and what was expected.
absl::StatusOr<ReconstructionOptions> ParseOptions(const std::string& options_json);

// The same for each side of the service.
absl::StatusOr<Method> ParseCoordinatorMethod(const std::string& options_json);
absl::StatusOr<JobMethod> ParseWorkerMethod(const std::string& options_json);

}  // namespace meshwright
