// SPDX-License-Identifier: Apache-2.0
#include <memory>
#include <string>

#include "cli/camera_stage.h"
#include "cli/commands.h"

namespace meshwright {
namespace {

constexpr char kExamples[] = R"(Examples:
  meshwright cameras photographs -o scene           # then: meshwright reconstruct scene -o mesh.ply
  meshwright cameras frames -o scene --pairs sequential --max-features 2048
Runs COLMAP (apt-get install colmap) and makes a scene of its format: scene/sparse/0, and scene/images, a link to the
photographs. Photographs' masks, black where nothing is to be looked at, are found in photographs/masks/NAME.EXT.png.
Stopped or killed, the same command goes on and ends with the same cameras.)";

struct Arguments {
  CameraEstimationSettings settings;
  std::string pairs = "auto";
  OutputSettings output;
};

int Cameras(const Arguments& arguments) {
  CameraEstimationSettings settings = arguments.settings;
  settings.pairs = PairSelectionOfName(arguments.pairs);
  CameraEstimate estimate;
  const int code = RunCameraStage(settings, arguments.output, &estimate);
  if (code != kExitDone) return code;
  if (arguments.output.json) {
    PrintJson({{"scene", settings.scene_folder},
               {"photographs", estimate.photographs},
               {"registered", estimate.registered},
               {"notes", estimate.notes}});
  }
  return kExitDone;
}

}  // namespace

void AddCamerasCommand(CLI::App& program, Run& run) {
  auto arguments = std::make_shared<Arguments>();
  CameraEstimationSettings& settings = arguments->settings;
  settings.threads = AvailableCores();
  CLI::App& command = *program.add_subcommand("cameras", "Estimate the cameras of photographs with COLMAP");
  command.footer(kExamples);
  command.add_option("PHOTOGRAPHS", settings.photographs, "folder of JPEG, PNG, PGM or PPM")->required();
  command.add_option("-o,--output", settings.scene_folder, "the scene to make, a folder")->required();
  command.add_option("--pairs", arguments->pairs, "which photographs are compared; auto: by their number and names")
      ->check(CLI::IsMember({"auto", "exhaustive", "sequential", "similar"}))
      ->capture_default_str();
  command
      .add_option("--max-features", settings.max_features,
                  "of a photograph; more find weaker overlaps, matching takes time with their square")
      ->check(CLI::Range(256, 65536))
      ->capture_default_str();
  command
      .add_option("--max-feature-image-size", settings.max_image_size,
                  "longer side in px to which photographs are scaled down for finding features")
      ->check(CLI::Range(200, 20000))
      ->capture_default_str();
  command.add_flag("--restart", settings.restart, "throw away cameras of other photographs that the folder holds");
  AddThreadsOption(command, settings.threads);
  AddOutputOptions(command, arguments->output);
  command.callback([arguments, &run] { run = [arguments] { return Cameras(*arguments); }; });
}

}  // namespace meshwright
