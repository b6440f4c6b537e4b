// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <memory>
#include <vector>

#include <absl/strings/str_cat.h>

#include "pipeline/inspection/inspection.h"
#include "pipeline/local/time_estimate.h"
#include "pipeline/options/option_table.h"

#include "cli/commands.h"
#include "cli/reconstruction_flags.h"
#include "common/base/bad_input.h"
#include "common/base/thread_pool.h"

namespace meshwright {
namespace {

constexpr char kExamples[] = R"(Examples:
  meshwright inspect scene
  meshwright inspect scene --preset fine             # how long will it take?
  meshwright inspect scene --max-image-size 1536 --threads 8 --json
Takes the options of reconstruct that matter before any work is done.)";

struct Arguments {
  SceneArguments scene;
  ReconstructionOptions options;
  int threads = AvailableCores();
  bool no_trial = false;
  OutputSettings output;
};

int RunCommand(const Arguments& arguments) {
  if (const absl::Status valid = CheckOptions(arguments.options, "--"); !valid.ok()) {
    return FailWrongUse(std::string(valid.message()));
  }
  const absl::StatusOr<Scene> scene = LoadScene(arguments.scene);
  if (!scene.ok()) return Fail(scene.status());
  ThreadPool pool(arguments.threads);
  const absl::StatusOr<Inspection> inspection = Inspect(*scene, arguments.options, pool);
  if (!inspection.ok()) return Fail(inspection.status());
  nlohmann::ordered_json json = ToJson(*inspection);
  std::string text = ToText(*inspection);
  if (!arguments.no_trial) {
    const absl::StatusOr<TimeEstimate> estimate = EstimateTime(*scene, arguments.options, arguments.threads);
    if (!estimate.ok()) return Fail(estimate.status());
    json["expected"]["time"] = ToJson(*estimate);
    absl::StrAppend(&text, "time       ", ToText(*estimate), "\n");
  }
  if (arguments.output.json) {
    PrintJson(json);
  } else {
    std::fputs(text.c_str(), stdout);
  }
  return kExitDone;
}

}  // namespace

void AddInspectCommand(CLI::App& program, Run& run) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *program.add_subcommand("inspect", "Say what a scene is and what its reconstruction will take");
  command.footer(kExamples);
  command.add_option("SCENE", arguments->scene.path, "folder with cameras and photographs")->required();
  AddSceneOptions(command, arguments->scene);
  command.add_flag("--no-trial", arguments->no_trial,
                   "do not say how long it will take, for which one or two cameras are tried");
  AddThreadsOption(command, arguments->threads);
  AddOutputOptions(command, arguments->output);
  AddReconstructionFlags(command, arguments->options);
  command.callback([arguments, &run] { run = [arguments] { return RunCommand(*arguments); }; });
}

}  // namespace meshwright
