// SPDX-License-Identifier: Apache-2.0
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>

#include <absl/strings/str_cat.h>
#include <unistd.h>

#include "pipeline/local/local_reconstruction.h"
#include "pipeline/local/time_estimate.h"
#include "pipeline/options/option_table.h"
#include "pipeline/report/verdict.h"

#include "cli/camera_stage.h"
#include "cli/commands.h"
#include "cli/loss_follower.h"
#include "cli/progress_display.h"
#include "cli/reconstruction_flags.h"
#include "common/base/clock.h"
#include "common/mesh/formats/mesh_format.h"

namespace meshwright {
namespace {

constexpr char kExamples[] = R"(Examples:
  meshwright reconstruct photographs -o mesh.ply
  meshwright reconstruct scene -o mesh.ply
  meshwright reconstruct scene -o model.glb                    # simplified, with a texture
  meshwright reconstruct fountain-P11 -o fountain.ply --max-image-size 1536
  meshwright reconstruct temple -o temple.ply --lattice-step 1 --support 2 --parts
Stopped or killed, the same command goes on from the last camera and ends with the same bytes.)";

struct Arguments {
  SceneArguments scene;
  ReconstructionOptions options;
  bool options_chosen_by_preset = false;
  LocalSettings settings;
  TextureOptions texture;
  bool no_texture = false;
  bool parts = false;
  int64_t memory_mib = 0;    // 0: by the number of threads
  std::string ground_truth;  // PLY; "": none
  OutputSettings output;
};

// State is safe at any moment, so stopping needs no clean-up: it only says how to go on.
extern "C" void OnStopSignal(int signal) {
  static const char message[] = "\nmeshwright: stopped; the same command goes on from the last camera\n";
  [[maybe_unused]] const ssize_t written = ::write(STDERR_FILENO, message, sizeof(message) - 1);
  ::_exit(128 + signal);
}

// out/mesh.ply -> out/mesh + suffix.
std::string BesideOutput(const std::string& output_path, const std::string& suffix) {
  return std::filesystem::path(output_path).replace_extension().string() + suffix;
}

// About half a GiB for each core, 1 GiB at least.
int64_t DefaultMemoryMib(int threads) { return std::max<int64_t>(1024, int64_t{512} * threads); }

void PrintSummary(const nlohmann::ordered_json& report, const LocalSettings& settings) {
  const auto& totals = report["totals"];
  const auto& process = report["process"];
  std::printf("mesh     %s: %s vertices, %s faces\n", settings.output_path.c_str(),
              FormatCount(report["mesh"]["vertices"].get<int64_t>()).c_str(),
              FormatCount(report["mesh"]["faces"].get<int64_t>()).c_str());
  std::printf("report   %s\n", settings.report_path.c_str());
  if (!settings.page_path.empty()) std::printf("page     %s\n", settings.page_path.c_str());
  if (report["scene"]["refinement"]["moved"].get<bool>()) {
    std::printf("refined  %s: for other commands, --refined-cameras\n", settings.cameras_path.c_str());
  }
  std::printf("cameras  %d processed\n", totals["cameras_processed"].get<int>());
  std::printf("rays     %s\n",
              DescribeShares(totals["share_covered_before"].get<double>(), totals["share_grown"].get<double>(),
                             totals["share_accepted"].get<double>())
                  .c_str());
  std::printf("verdict  %s\n", DescribeVerdict(report["verdict"]).c_str());
  if (const std::string warning = DescribeWarning(report["verdict"]); !warning.empty()) {
    std::printf("warning  %s\n", warning.c_str());
  }
  std::printf("took     %s (%s of CPU), %s of memory at most\n",
              FormatDuration(process["wall_seconds"].get<double>()).c_str(),
              FormatDuration(process["cpu_seconds"].get<double>()).c_str(),
              FormatBytes(process["peak_memory_bytes"].get<double>()).c_str());
}

// The cameras stay beside the mesh when it is done: another mesh of the same photographs need not wait for them again.
int EstimateCamerasFirst(Arguments& arguments) {
  CameraEstimationSettings settings;
  settings.photographs = arguments.scene.path;
  settings.scene_folder = BesideOutput(arguments.settings.output_path, ".cameras");
  settings.threads = arguments.settings.threads;
  settings.restart = arguments.settings.restart;
  CameraEstimate estimate;
  const int code = RunCameraStage(settings, arguments.output, &estimate);
  arguments.scene.path = settings.scene_folder;
  return code;
}

int Reconstruct(Arguments& arguments) {
  LocalSettings& settings = arguments.settings;
  if (const absl::Status valid = CheckOptions(arguments.options, "--"); !valid.ok()) {
    return FailWrongUse(std::string(valid.message()));
  }
  const absl::StatusOr<const MeshFormat*> format = MeshFormatOfPath(settings.output_path);
  if (!format.ok()) return FailWrongUse(std::string(format.status().message()));
  if (!arguments.ground_truth.empty() && !IsPly(**format)) {
    return FailWrongUse(absl::StrCat("-o is ", settings.output_path, ", expected a .ply with --ground-truth"));
  }
  for (const absl::Status& valid :
       {arguments.texture.Validate(), CheckCompressible(**format, settings.write, settings.output_path)}) {
    if (!valid.ok()) return FailWrongUse(std::string(valid.message()));
  }
  if (!arguments.no_texture) {
    settings.texture = arguments.texture;
    settings.texture->max_image_size = arguments.options.max_image_size;
    settings.texture->compressed = settings.write.compressed;
  }
  settings.report_path = BesideOutput(settings.output_path, ".report.json");
  settings.cameras_path = BesideOutput(settings.output_path, ".cameras.json");
  if (settings.work_folder.empty()) settings.work_folder = settings.output_path + ".work";
  if (arguments.parts) settings.parts_folder = BesideOutput(settings.output_path, ".parts");
  const int64_t mebibytes = arguments.memory_mib > 0 ? arguments.memory_mib : DefaultMemoryMib(settings.threads);
  settings.memory_limit_bytes = mebibytes << 20;

  if (LacksCameras(arguments.scene)) {
    if (const int code = EstimateCamerasFirst(arguments); code != kExitDone) return code;
  }
  const absl::StatusOr<Scene> scene = LoadScene(arguments.scene);
  if (!scene.ok()) return Fail(scene.status());
  std::signal(SIGINT, OnStopSignal);
  std::signal(SIGTERM, OnStopSignal);
  const RealClock clock;
  if (arguments.options_chosen_by_preset && !arguments.output.quiet) {
    const absl::StatusOr<TimeEstimate> estimate = EstimateTime(*scene, arguments.options, settings.threads);
    if (!estimate.ok()) return Fail(estimate.status());
    std::fprintf(stderr, "%s\n", ToText(*estimate).c_str());
  }
  ProgressDisplay display(ProgressDisplay::StyleFor(stderr, arguments.output.quiet), stderr, clock);
  CameraJobFunction job = [&](const CameraJobInput& input, ThreadPool& pool) {
    return RunCameraJob(input, arguments.options.job, pool);
  };
  ThreadPool losses_pool(settings.threads);
  std::unique_ptr<LossFollower> losses;
  if (!arguments.ground_truth.empty()) {
    absl::StatusOr<std::unique_ptr<LossFollower>> followed =
        FollowLosses(arguments.ground_truth, *scene, arguments.options, losses_pool);
    if (!followed.ok()) return Fail(followed.status());
    losses = *std::move(followed);
    job = [&](const CameraJobInput& input, ThreadPool& pool) { return losses->RunJob(input, pool); };
    settings.accepted_listener = [&](const PatchLattice& accepted) { losses->RecordAccepted(accepted); };
    settings.add_to_report = [&](const std::string& ply_path, nlohmann::ordered_json& to) {
      return losses->Account(ply_path, to);
    };
  }
  absl::StatusOr<nlohmann::ordered_json> report = ReconstructLocally(
      *scene, arguments.options, settings, job, [&](const LocalProgress& progress) { display.Show(progress); });
  display.End();
  if (!report.ok()) return Fail(report.status());
  if (losses != nullptr) std::fputs(losses->Words().c_str(), stderr);
  if (arguments.output.json) {
    report->erase("cameras");
    (*report)["report"] = settings.report_path;
    if (!settings.page_path.empty()) (*report)["report_html"] = settings.page_path;
    PrintJson(*report);
  } else {
    PrintSummary(*report, settings);
  }
  return kExitDone;
}

}  // namespace

void AddReconstructCommand(CLI::App& program, Run& run) {
  auto arguments = std::make_shared<Arguments>();
  arguments->settings.threads = AvailableCores();
  CLI::App& command = *program.add_subcommand("reconstruct", "Turn photographs into a mesh");
  command.footer(kExamples);
  command
      .add_option(
          "SCENE", arguments->scene.path,
          "folder with photographs and their cameras; without cameras COLMAP estimates them, into OUTPUT.cameras/")
      ->required();
  command
      .add_option("-o,--output", arguments->settings.output_path,
                  absl::StrCat("the mesh to write; its ending says the format: ", MeshFormatEndings()))
      ->required();
  AddSceneOptions(command, arguments->scene);
  command.add_flag("--no-texture", arguments->no_texture,
                   "GLB and OBJ with the whole mesh and colours at its vertices, not simplified with a texture");
  AddTextureOptions(command, arguments->texture);
  AddCompressOption(command, arguments->settings.write.compressed);
  command.add_flag("--parts", arguments->parts, "also write one PLY per reference camera, into OUTPUT.parts/");
  command.add_option("--work-dir", arguments->settings.work_folder,
                     "state and surfaces while it runs [OUTPUT.ply.work]; removed at the end");
  command.add_flag("--keep-work-dir", arguments->settings.keep_work_folder, "do not remove it at the end");
  command.add_flag("--restart", arguments->settings.restart, "begin anew, whatever the work folder holds");
  command.add_option("--ground-truth", arguments->ground_truth,
                     "the true surface, a PLY mesh: say at which stage each of its pixels that is missing was lost");
  command
      .add_option("--report-html", arguments->settings.page_path,
                  "also write the report as one HTML page: what of each photograph the mesh shows, where rays were "
                  "lost, times, options, pictures")
      ->type_name("FILE");
  AddThreadsOption(command, arguments->settings.threads);
  command
      .add_option("--memory", arguments->memory_mib,
                  "MiB to stay below: fewer cameras at the same time where they are large; no influence on the "
                  "result [512 for each thread, at least 1024]")
      ->check(CLI::Range(int64_t{64}, int64_t{1} << 30));
  AddOutputOptions(command, arguments->output);
  AddReconstructionFlags(command, arguments->options);
  command.callback([arguments, &command, &run] {
    arguments->options_chosen_by_preset = command.count("--preset") > 0;
    run = [arguments] { return Reconstruct(*arguments); };
  });
}

}  // namespace meshwright
