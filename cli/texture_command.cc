// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <memory>
#include <optional>

#include <absl/strings/str_cat.h>
#include <unistd.h>

#include "pipeline/texturing/texture_mesh.h"

#include "cli/commands.h"
#include "common/base/bad_input.h"
#include "common/base/process_usage.h"
#include "common/base/status_macros.h"
#include "common/base/thread_pool.h"
#include "common/mesh/formats/mesh_format.h"
#include "common/mesh/ply.h"

namespace meshwright {
namespace {

constexpr char kExamples[] = R"(Examples:
  meshwright texture scene mesh.ply -o model.glb
  meshwright texture scene mesh.ply -o model.obj --texture-png --texture-error 0.5
The mesh is simplified, each triangle gets the photograph that shows it best, and the pieces are levelled at their seams
(Waechter, Moehrle, Goesele: Let There Be Color!, 2014).)";

struct Arguments {
  SceneArguments scene;
  std::string mesh;
  std::string output_path;
  std::string simplified_path;
  TextureOptions options;
  int threads = AvailableCores();
  OutputSettings output;
};

absl::StatusOr<TextureReport> Texture(const Arguments& arguments, const MeshFormat& format) {
  ThreadPool pool(arguments.threads);
  MW_ASSIGN_OR_RETURN(const Scene scene, LoadScene(arguments.scene));
  absl::StatusOr<TriangleMesh> mesh = ReadPly(arguments.mesh);
  if (!mesh.ok()) return BadInput(mesh.status());
  const bool is_terminal = ::isatty(STDERR_FILENO) == 1;
  const auto progress = [&](int done, int total) {
    if (arguments.output.quiet || !is_terminal) return;
    std::fprintf(stderr, "\rphotographs %d/%d%s", done, total, done == total ? "\n" : "");
  };
  TriangleMesh simplified;
  absl::StatusOr<TextureReport> report =
      WriteTexturedMesh(*std::move(mesh), scene, arguments.options, format, arguments.output_path, pool, progress,
                        arguments.simplified_path.empty() ? nullptr : &simplified);
  if (absl::IsFailedPrecondition(report.status())) return BadInput(report.status());
  if (report.ok() && !arguments.simplified_path.empty()) {
    MW_RETURN_IF_ERROR(WritePly(simplified, arguments.simplified_path));
  }
  return report;
}

int RunCommand(const Arguments& arguments) {
  const absl::StatusOr<const MeshFormat*> format = MeshFormatOfPath(arguments.output_path);
  if (!format.ok()) return FailWrongUse(std::string(format.status().message()));
  if (!(*format)->textured) {
    return FailWrongUse(
        absl::StrCat(arguments.output_path, ": ", (*format)->title, " carries no texture, expected ", ".glb or .obj"));
  }
  for (const absl::Status& valid :
       {arguments.options.Validate(),
        CheckCompressible(**format, {.compressed = arguments.options.compressed}, arguments.output_path)}) {
    if (!valid.ok()) return FailWrongUse(std::string(valid.message()));
  }
  const absl::StatusOr<TextureReport> report = Texture(arguments, **format);
  if (!report.ok()) return Fail(report.status());
  const ProcessUsage usage = MeasureProcessUsage();
  if (arguments.output.json) {
    nlohmann::ordered_json json = ToJson(*report);
    json["cpu_seconds"] = usage.cpu_seconds;
    json["peak_memory_bytes"] = usage.peak_rss_bytes;
    PrintJson(json);
    return kExitDone;
  }
  std::printf("model    %s: %s faces, %s pieces of photographs on %s pages; %s faces are in no photograph\n",
              arguments.output_path.c_str(), FormatCount(report->faces).c_str(), FormatCount(report->charts).c_str(),
              FormatCount(report->pages).c_str(), FormatCount(report->faces_unseen).c_str());
  std::printf("seams    %.2f grey levels as photographed, %.2f once levelled\n", report->seam_jump_photographs,
              report->seam_jump_leveled);
  std::printf("took     %s of CPU, %s of memory at most\n", FormatDuration(usage.cpu_seconds).c_str(),
              FormatBytes(static_cast<double>(usage.peak_rss_bytes)).c_str());
  return kExitDone;
}

}  // namespace

void AddTextureOptions(CLI::App& command, TextureOptions& options) {
  const char* group = "Texture";
  command
      .add_option("--texture-error", options.max_error,
                  "leave out triangles up to this error, pixel footprints g, 0..100; 0: none")
      ->group(group)
      ->capture_default_str();
  command.add_option("--texture-size", options.max_page_size, "largest side of a page of the atlas, px, 256..16384")
      ->group(group)
      ->capture_default_str();
  command
      .add_option("--seam-cost", options.seam_cost,
                  "of an edge between two photographs, against the share of the best photograph's quality that is lost")
      ->group(group)
      ->capture_default_str();
  command.add_option("--jpeg-quality", options.jpeg_quality, "of the pages, 1..100")
      ->group(group)
      ->capture_default_str();
  command.add_flag("--texture-png", options.png, "pages without loss, PNG in place of JPEG")->group(group);
}

void AddCompressOption(CLI::App& command, bool& compressed) {
  command.add_flag(
      "--compress", compressed,
      "GLB and 3D Tiles by EXT_meshopt_compression, a quarter of the size, for viewers that have its decoder "
      "(three.js, Cesium, Babylon.js)");
}

void AddTextureCommand(CLI::App& program, Run& run) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *program.add_subcommand("texture", "Give a mesh a texture cut from the scene's photographs");
  command.footer(kExamples);
  command.add_option("SCENE", arguments->scene.path, "folder with cameras and photographs")->required();
  command.add_option("MESH", arguments->mesh, "PLY, in the scene's coordinates")->required();
  AddSceneOptions(command, arguments->scene);
  command.add_option("-o,--output", arguments->output_path, "the model to write, .glb or .obj")->required();
  command.add_option("--simplified", arguments->simplified_path,
                     "also write the simplified mesh with the colours of its vertices, PLY");
  command.add_option("--max-image-size", arguments->options.max_image_size, "longest side of the photographs used, px")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  AddTextureOptions(command, arguments->options);
  AddCompressOption(command, arguments->options.compressed);
  AddThreadsOption(command, arguments->threads);
  AddOutputOptions(command, arguments->output);
  command.callback([arguments, &run] { run = [arguments] { return RunCommand(*arguments); }; });
}

}  // namespace meshwright
