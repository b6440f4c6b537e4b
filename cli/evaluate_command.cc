// SPDX-License-Identifier: Apache-2.0
#include <memory>
#include <vector>

#include "tools/evaluation/evaluation.h"

#include "cli/commands.h"
#include "common/base/bad_input.h"
#include "common/base/status_macros.h"
#include "common/base/thread_pool.h"
#include "common/mesh/ply.h"
#include "common/scene/view.h"

namespace meshwright {
namespace {

constexpr char kExamples[] = R"(Examples:
  meshwright evaluate mesh.ply ground_truth.ply --scene scene
  meshwright evaluate points.ply ground_truth.ply --scene scene --max-image-size 768 --json
R@k, P@k, F@k: share within k pixel footprints of the other surface, as the photographs see it. D@k: share of
ground-truth pixels whose depth is right within k footprints; missing counts as wrong.)";

struct Arguments {
  std::string reconstruction;
  std::string ground_truth;
  SceneArguments scene;
  int max_image_size = 0;
  EvaluationOptions options;
  int threads = AvailableCores();
  OutputSettings output;
};

absl::StatusOr<EvaluationReport> RunEvaluation(const Arguments& arguments) {
  ThreadPool pool(arguments.threads);
  MW_ASSIGN_OR_RETURN(const Scene scene, LoadScene(arguments.scene));
  std::vector<Camera> cameras;
  for (const SceneView& view : scene.views) cameras.push_back(UndistortedCamera(view, arguments.max_image_size));
  absl::StatusOr<TriangleMesh> reconstruction = ReadPly(arguments.reconstruction);
  if (!reconstruction.ok()) return BadInput(reconstruction.status());
  absl::StatusOr<TriangleMesh> ground_truth = ReadPly(arguments.ground_truth);
  if (!ground_truth.ok()) return BadInput(ground_truth.status());
  ChangeOffset(scene.offset, *reconstruction);
  ChangeOffset(scene.offset, *ground_truth);
  absl::StatusOr<EvaluationReport> report = Evaluate(*reconstruction, *ground_truth, cameras, arguments.options, pool);
  if (!report.ok()) return BadInput(report.status());
  return report;
}

int RunCommand(const Arguments& arguments) {
  if (const absl::Status valid = arguments.options.Validate(); !valid.ok()) {
    return FailWrongUse(std::string(valid.message()));
  }
  const absl::StatusOr<EvaluationReport> report = RunEvaluation(arguments);
  if (!report.ok()) return Fail(report.status());
  if (arguments.output.json) {
    PrintJson(ToJson(*report));
  } else {
    std::fputs(ToText(*report).c_str(), stdout);
  }
  return kExitDone;
}

}  // namespace

void AddEvaluateCommand(CLI::App& program, Run& run) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *program.add_subcommand("evaluate", "Measure a mesh or point cloud against ground truth");
  command.footer(kExamples);
  command.add_option("RECONSTRUCTION", arguments->reconstruction, "mesh or point cloud, PLY")->required();
  command.add_option("GROUND_TRUTH", arguments->ground_truth, "mesh, PLY")->required();
  command.add_option("--scene", arguments->scene.path, "folder with the cameras")->required();
  AddSceneOptions(command, arguments->scene);
  command
      .add_option("--max-image-size", arguments->max_image_size,
                  "longest side of the images at which the comparison is made, px; 0: as they are")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command.add_option("--pixel-stride", arguments->options.pixel_stride, "look at every n-th pixel in x and y")
      ->capture_default_str();
  command.add_option("--min-views", arguments->options.min_views, "recall asks for what so many cameras see")
      ->capture_default_str();
  command
      .add_option("--completeness-distance", arguments->options.completeness_distance,
                  "of Middlebury's completeness, scene units; 0: two median pixel footprints")
      ->capture_default_str();
  AddThreadsOption(command, arguments->threads);
  AddOutputOptions(command, arguments->output);
  command.callback([arguments, &run] { run = [arguments] { return RunCommand(*arguments); }; });
}

}  // namespace meshwright
