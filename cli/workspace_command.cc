// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <memory>
#include <string>

#include <absl/strings/str_cat.h>
#include <unistd.h>

#include "pipeline/workspace/workspace.h"

#include "cli/commands.h"
#include "common/base/bad_input.h"
#include "common/base/status_macros.h"
#include "common/base/thread_pool.h"
#include "common/mesh/ply.h"

namespace meshwright {
namespace {

constexpr char kExamples[] = R"(Examples:
  meshwright workspace scene mesh.ply --for colmap -o dense     # then: colmap stereo_fusion --workspace_path dense
                                                                #   --input_type geometric --output_path fused.ply
  meshwright workspace scene mesh.ply --for openmvs -o mvs      # then: TextureMesh scene.mvs -m mesh.ply)";

struct Arguments {
  SceneArguments scene;
  std::string mesh;
  std::string program;
  WorkspaceSettings settings;
  int threads = AvailableCores();
  OutputSettings output;
};

absl::Status Write(const Arguments& arguments) {
  ThreadPool pool(arguments.threads);
  MW_ASSIGN_OR_RETURN(const Scene scene, LoadScene(arguments.scene));
  absl::StatusOr<TriangleMesh> mesh = ReadPly(arguments.mesh);
  if (!mesh.ok()) return BadInput(mesh.status());
  const bool is_terminal = ::isatty(STDERR_FILENO) == 1;
  const auto progress = [&](int done, int total) {
    if (arguments.output.quiet || !is_terminal) return;
    std::fprintf(stderr, "\rphotographs %d/%d%s", done, total, done == total ? "\n" : "");
  };
  const auto write = arguments.program == "colmap" ? WriteColmapWorkspace : WriteOpenMvsWorkspace;
  return write(scene, *std::move(mesh), arguments.settings, pool, progress);
}

int RunCommand(const Arguments& arguments) {
  const absl::Status status = Write(arguments);
  return status.ok() ? kExitDone : Fail(status);
}

}  // namespace

void AddWorkspaceCommand(CLI::App& program, Run& run) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *program.add_subcommand(
      "workspace", "Write undistorted photographs, cameras and a mesh's depth maps for another program");
  command.footer(kExamples);
  command.add_option("SCENE", arguments->scene.path, "folder with cameras and photographs")->required();
  command.add_option("MESH", arguments->mesh, "mesh of the scene, PLY")->required();
  command.add_option("--for", arguments->program, "colmap: depth and normal maps; openmvs: scene.mvs and mesh.ply")
      ->check(CLI::IsMember({"colmap", "openmvs"}))
      ->required()
      ->type_name("PROGRAM");
  command.add_option("-o,--output", arguments->settings.folder, "the folder to write")->required();
  AddSceneOptions(command, arguments->scene);
  command
      .add_option("--max-image-size", arguments->settings.max_image_size,
                  "longest side of the photographs and maps, px; 0: as they are")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  AddThreadsOption(command, arguments->threads);
  command.add_flag("-q,--quiet", arguments->output.quiet, "no progress");
  command.callback([arguments, &run] { run = [arguments] { return RunCommand(*arguments); }; });
}

}  // namespace meshwright
