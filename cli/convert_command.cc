// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <memory>
#include <system_error>

#include <absl/strings/str_cat.h>

#include "cli/commands.h"
#include "common/base/bad_input.h"
#include "common/base/status_macros.h"
#include "common/mesh/formats/mesh_format.h"

namespace meshwright {
namespace {

constexpr char kExamples[] = R"(Examples:
  meshwright convert mesh.ply -o mesh.glb
  meshwright convert mesh.ply -o mesh.glb --compress    # for web pages
  meshwright convert mesh.ply -o cloud.las
  meshwright convert mesh.ply -o city/tileset.json      # 3D Tiles, in a folder
  meshwright convert mesh.ply --points -o cloud.ply)";

struct Arguments {
  std::string mesh;
  std::string output_path;
  bool points = false;
  MeshWriteOptions write;
};

absl::Status Convert(const Arguments& arguments, const MeshFormat& format) {
  std::error_code error;
  if (std::filesystem::equivalent(arguments.mesh, arguments.output_path, error)) {
    return absl::InvalidArgumentError(absl::StrCat(arguments.output_path, ": the mesh that is to be read"));
  }
  absl::StatusOr<MeshRows> mesh = MeshRows::OpenPly(arguments.mesh);
  if (!mesh.ok()) return BadInput(mesh.status());
  if (arguments.points) mesh->DropFaces();
  absl::Status written = format.write(*mesh, arguments.output_path, arguments.write);
  return absl::IsInvalidArgument(written) ? BadInput(written) : written;
}

int RunCommand(const Arguments& arguments) {
  const absl::StatusOr<const MeshFormat*> format = MeshFormatOfPath(arguments.output_path);
  if (!format.ok()) return FailWrongUse(std::string(format.status().message()));
  if (const absl::Status valid = CheckCompressible(**format, arguments.write, arguments.output_path); !valid.ok()) {
    return FailWrongUse(std::string(valid.message()));
  }
  const absl::Status status = Convert(arguments, **format);
  return status.ok() ? kExitDone : Fail(status);
}

}  // namespace

void AddConvertCommand(CLI::App& program, Run& run) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *program.add_subcommand("convert", "Write a mesh in another format");
  command.footer(kExamples);
  command.add_option("MESH", arguments->mesh, "PLY")->required();
  command
      .add_option("-o,--output", arguments->output_path,
                  absl::StrCat("what to write; its ending says the format: ", MeshFormatEndings()))
      ->required();
  command.add_flag("--points", arguments->points, "the vertices alone, as a point cloud");
  AddCompressOption(command, arguments->write.compressed);
  command.callback([arguments, &run] { run = [arguments] { return RunCommand(*arguments); }; });
}

}  // namespace meshwright
