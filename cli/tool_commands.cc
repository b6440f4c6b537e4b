// SPDX-License-Identifier: Apache-2.0
#include "cli/commands.h"

namespace meshwright {

void AddToolCommands(CLI::App& program, Run& run) {
  AddEvaluateCommand(program, run);
  AddSynthesizeCommand(program, run);
  AddRenderCommand(program, run);
}

}  // namespace meshwright
