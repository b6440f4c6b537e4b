// SPDX-License-Identifier: Apache-2.0
// In the place of tool_commands.cc and loss_follower.cc in a build without tools/.
#include <string>

#include <absl/strings/str_cat.h>

#include "cli/commands.h"
#include "cli/loss_follower.h"

namespace meshwright {
namespace {

std::string Explain(const std::string& what) {
  return absl::StrCat(what, " is not part of this build: it needs Embree (MESHWRIGHT_BUILD_TOOLS=ON)");
}

}  // namespace

void AddToolCommands(CLI::App& program, Run& run) {
  for (const char* const name : {"evaluate", "synthesize", "render"}) {
    CLI::App& command = *program.add_subcommand(name, "Not part of this build (no Embree)");
    command.allow_extras();
    command.callback([name, &run] { run = [name] { return FailWrongUse(Explain(name)); }; });
  }
}

absl::StatusOr<std::unique_ptr<LossFollower>> FollowLosses(const std::string& /*ground_truth*/, const Scene& /*scene*/,
                                                           const ReconstructionOptions& /*options*/,
                                                           ThreadPool& /*pool*/) {
  return absl::UnimplementedError(Explain("--ground-truth"));
}

}  // namespace meshwright
