// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>

#include <CLI/CLI.hpp>
#include <absl/status/statusor.h>

#include "pipeline/texturing/texture_options.h"
#include "program/console.h"

#include "common/scene/formats/import_options.h"
#include "common/scene/scene.h"

namespace meshwright {

// Each adds one subcommand to the program. What it is to do is put into `run`, which returns the exit code, when the
// user chose it.
using Run = std::function<int()>;
void AddReconstructCommand(CLI::App& program, Run& run);
void AddCamerasCommand(CLI::App& program, Run& run);
void AddInspectCommand(CLI::App& program, Run& run);
// evaluate, synthesize, render: they need tools/, and a build without it has commands of these names that say so.
void AddToolCommands(CLI::App& program, Run& run);
void AddEvaluateCommand(CLI::App& program, Run& run);
void AddSynthesizeCommand(CLI::App& program, Run& run);
void AddConvertCommand(CLI::App& program, Run& run);
void AddCropCommand(CLI::App& program, Run& run);
void AddWorkspaceCommand(CLI::App& program, Run& run);
void AddRenderCommand(CLI::App& program, Run& run);
void AddSubmitCommand(CLI::App& program, Run& run);
void AddOptionsCommand(CLI::App& program, Run& run);
void AddTextureCommand(CLI::App& program, Run& run);
void AddUpCommand(CLI::App& program, Run& run);
// status, watch, fetch, cancel, delete, workers.
void AddServiceCommands(CLI::App& program, Run& run);
// token create, list, revoke.
void AddTokenCommand(CLI::App& program, Run& run);

// Options that several commands share.
struct SceneArguments {
  std::string path;
  ImportOptions import;
  std::string refined_cameras;  // a file that reconstruct left of this scene; "": the scene's own cameras
};
// --format, --model, --images, --masks, --region and what else says how a scene is read.
void AddSceneOptions(CLI::App& command, SceneArguments& scene);
void AddOutputOptions(CLI::App& command, OutputSettings& output);
// --texture-error and what else an atlas depends on.
void AddTextureOptions(CLI::App& command, TextureOptions& options);
void AddCompressOption(CLI::App& command, bool& compressed);
void AddThreadsOption(CLI::App& command, int& threads);

// Cores that this process may use.
int AvailableCores();
// Errors are bad input. What was left out of the scene is said on stderr, a line each.
absl::StatusOr<Scene> LoadScene(const SceneArguments& arguments);

// Photographs and nothing that tells their cameras.
bool LacksCameras(const SceneArguments& arguments);

}  // namespace meshwright
