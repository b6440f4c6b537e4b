// SPDX-License-Identifier: Apache-2.0
#include <memory>
#include <optional>

#include <absl/strings/str_cat.h>

#include "tools/synthetic/synthetic_scene.h"

#include "cli/commands.h"
#include "common/base/status_macros.h"
#include "common/base/thread_pool.h"

namespace meshwright {
namespace {

constexpr char kExamples[] = R"(Examples:
  meshwright synthesize facade -o facade
  meshwright synthesize ring -o ring --cameras 47 --width 640 --height 480
  meshwright synthesize room -o room --cameras 48 --width 960 --height 720 --points 0
  meshwright synthesize street -o street --cameras 200 --seed 7
A room is photographed as people do: exposures, compression and cameras are a little off unless told otherwise.
FOLDER gets model/ (COLMAP text), images/ and ground_truth.ply: meshwright reconstruct FOLDER reads it.)";

struct Arguments {
  std::string kind;
  std::string folder;
  SyntheticOptions options;
  std::optional<double> exposure_ev;
  std::optional<int> jpeg_quality;
  std::optional<double> camera_noise_px;
  int threads = AvailableCores();
  OutputSettings output;
};

absl::Status Synthesize(const Arguments& arguments) {
  ThreadPool pool(arguments.threads);
  MW_ASSIGN_OR_RETURN(const SyntheticScene scene, MakeSyntheticScene(arguments.options, pool));
  return WriteSyntheticScene(scene, arguments.folder, pool);
}

int RunCommand(Arguments& arguments) {
  absl::StatusOr<SyntheticKind> kind = ParseSyntheticKind(arguments.kind);
  if (!kind.ok()) return FailWrongUse(std::string(kind.status().message()));
  SyntheticOptions& options = arguments.options;
  options.kind = *kind;
  const bool in_a_room = *kind == SyntheticKind::kRoom;
  options.exposure_ev = arguments.exposure_ev.value_or(in_a_room ? 0.5 : 0);
  options.jpeg_quality = arguments.jpeg_quality.value_or(in_a_room ? 60 : 0);
  options.camera_noise_px = arguments.camera_noise_px.value_or(in_a_room ? 0.5 : 0);
  if (const absl::Status valid = arguments.options.Validate(); !valid.ok()) {
    return FailWrongUse(std::string(valid.message()));
  }
  if (const absl::Status status = Synthesize(arguments); !status.ok()) return Fail(status);
  if (arguments.output.json) {
    PrintJson({{"scene", arguments.folder},
               {"photographs", arguments.options.cameras},
               {"ground_truth", absl::StrCat(arguments.folder, "/ground_truth.ply")}});
  } else {
    std::printf("scene         %s: %d photographs of %dx%d\nground truth  %s/ground_truth.ply\n",
                arguments.folder.c_str(), arguments.options.cameras, arguments.options.width, arguments.options.height,
                arguments.folder.c_str());
  }
  return kExitDone;
}

}  // namespace

void AddSynthesizeCommand(CLI::App& program, Run& run) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *program.add_subcommand("synthesize", "Make a scene with exact ground truth");
  command.footer(kExamples);
  command.add_option("KIND", arguments->kind, "facade, ring, room or street")->required();
  command.add_option("-o,--output", arguments->folder, "folder to write")->required();
  SyntheticOptions& options = arguments->options;
  command.add_option("--cameras", options.cameras, "photographs, 2..10000; facade at most 24")->capture_default_str();
  command.add_option("--width", options.width, "of a photograph, px, 64..8192")->capture_default_str();
  command.add_option("--height", options.height, "of a photograph, px, 64..8192")->capture_default_str();
  command.add_option("--seed", options.seed, "of everything that is drawn by lot")->capture_default_str();
  command.add_option("--noise", options.noise_sigma, "of the sensor, grey levels, 0..50")->capture_default_str();
  command.add_option("--exposure-ev", arguments->exposure_ev,
                     "exposures differ by up to so much from the mean, EV, 0..4 [0.5 in a room, else 0]");
  command.add_option("--jpeg-quality", arguments->jpeg_quality,
                     "photographs went through JPEG, 1..100; 0: not [60 in a room, else 0]");
  command.add_option("--camera-noise", arguments->camera_noise_px,
                     "by how much the cameras that are told are off, px, 0..20 [0.5 in a room, else 0]");
  command
      .add_option("--points", options.sparse_points_per_camera,
                  "sparse points per camera, as structure from motion would find; 0: none")
      ->capture_default_str();
  AddThreadsOption(command, arguments->threads);
  AddOutputOptions(command, arguments->output);
  command.callback([arguments, &run] { run = [arguments] { return RunCommand(*arguments); }; });
}

}  // namespace meshwright
