// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <new>

#include <CLI/CLI.hpp>
#include <absl/strings/str_cat.h>

#include "program/console.h"
#include "program/environment.h"
#include "program/program_options.h"
#include "program/usage_error.h"

#include "cli/commands.h"
#include "common/base/version.h"

int main(int argc, char** argv) {
  using namespace meshwright;
  KeepMemoryLow();
  IgnoreFileSizeSignal();
  CLI::App program(
      "Meshwright turns photographs into a triangle mesh (Jancosek, Shekhovtsov, "
      "Pajdla: Scalable Multi-View Stereo, 2009).",
      "meshwright");
  program.set_version_flag("--version", absl::StrCat("meshwright ", kProgramVersion));
  program.require_subcommand(1);
  program.footer(
      "meshwright COMMAND --help shows a command's options and examples.\n"
      "Exit codes: 0 done, 1 failed, 2 wrong use, 3 bad input.");
  Run run;
  AddReconstructCommand(program, run);
  AddCamerasCommand(program, run);
  AddInspectCommand(program, run);
  AddConvertCommand(program, run);
  AddCropCommand(program, run);
  AddWorkspaceCommand(program, run);
  AddTextureCommand(program, run);
  AddToolCommands(program, run);
  AddOptionsCommand(program, run);
  AddUpCommand(program, run);
  AddSubmitCommand(program, run);
  AddServiceCommands(program, run);
  AddTokenCommand(program, run);
  if (const auto environment = SettingsOfEnvironment({}); !environment.ok()) {
    return FailWrongUse(std::string(environment.status().message()));
  }
  try {
    program.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return program.exit(error);  // --help, --version
    return FailWrongUse(absl::StrCat(DescribeUsageError(program, error), " (--help shows what is expected)"));
  }
  try {
    return run();
  } catch (const std::bad_alloc&) {
    std::fprintf(stderr, "meshwright: out of memory\n");
    return kExitFailed;
  }
}
