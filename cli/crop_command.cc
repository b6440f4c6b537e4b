// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include <absl/strings/str_cat.h>

#include "cli/commands.h"
#include "common/base/bad_input.h"
#include "common/base/status_macros.h"
#include "common/mesh/formats/mesh_format.h"
#include "common/mesh/ply.h"
#include "common/scene/formats/region_file.h"

namespace meshwright {
namespace {

constexpr char kExamples[] = R"(Examples:
  meshwright crop mesh.ply --region box.json -o part.ply
  meshwright crop mesh.ply --region box.json -o part.glb
box.json: [xmin, ymin, zmin, xmax, ymax, zmax], or {"center": [x, y, z], "axes": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
"size": [x, y, z]} with full lengths, in the coordinates of the mesh.)";

struct Arguments {
  std::string mesh;
  std::string region;
  std::string output_path;
};

constexpr uint32_t kOutside = std::numeric_limits<uint32_t>::max();

// The vertices in the box, and the faces that have all corners in it.
TriangleMesh Cropped(const TriangleMesh& mesh, const OrientedBox& box) {
  TriangleMesh part;
  part.offset = mesh.offset;
  std::vector<uint32_t> new_index(mesh.positions.size(), kOutside);
  const auto copy = [](const auto& from, size_t i, auto& to) {
    if (!from.empty()) to.push_back(from[i]);
  };
  for (size_t v = 0; v < mesh.positions.size(); ++v) {
    if (!box.Contains(mesh.positions[v].cast<double>() + mesh.offset)) continue;
    new_index[v] = static_cast<uint32_t>(part.positions.size());
    part.positions.push_back(mesh.positions[v]);
    copy(mesh.normals, v, part.normals);
    copy(mesh.colors, v, part.colors);
    copy(mesh.quality, v, part.quality);
    copy(mesh.cameras, v, part.cameras);
  }
  for (const auto& face : mesh.faces) {
    const std::array<uint32_t, 3> corners = {new_index[face[0]], new_index[face[1]], new_index[face[2]]};
    if (std::find(corners.begin(), corners.end(), kOutside) == corners.end()) part.faces.push_back(corners);
  }
  return part;
}

absl::Status Crop(const Arguments& arguments, const MeshFormat& format) {
  const absl::StatusOr<OrientedBox> box = ReadRegion(arguments.region);
  if (!box.ok()) return BadInput(box.status());
  const absl::StatusOr<TriangleMesh> mesh = ReadPly(arguments.mesh);
  if (!mesh.ok()) return BadInput(mesh.status());
  const TriangleMesh part = Cropped(*mesh, *box);
  if (part.positions.empty()) {
    return BadInput(absl::FailedPreconditionError(
        absl::StrCat(arguments.region, ": nothing of ", arguments.mesh, " is in the box")));
  }
  const absl::Status written = format.write(MeshRows(part), arguments.output_path, {});
  return absl::IsInvalidArgument(written) ? BadInput(written) : written;
}

int RunCommand(const Arguments& arguments) {
  const absl::StatusOr<const MeshFormat*> format = MeshFormatOfPath(arguments.output_path);
  if (!format.ok()) return FailWrongUse(std::string(format.status().message()));
  const absl::Status status = Crop(arguments, **format);
  return status.ok() ? kExitDone : Fail(status);
}

}  // namespace

void AddCropCommand(CLI::App& program, Run& run) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *program.add_subcommand("crop", "Keep what is in a box of a mesh");
  command.footer(kExamples);
  command.add_option("MESH", arguments->mesh, "mesh or point cloud, PLY")->required();
  command.add_option("--region", arguments->region, "the box, JSON")->required()->type_name("FILE");
  command
      .add_option("-o,--output", arguments->output_path,
                  absl::StrCat("what to write; its ending says the format: ", MeshFormatEndings()))
      ->required();
  command.callback([arguments, &run] { run = [arguments] { return RunCommand(*arguments); }; });
}

}  // namespace meshwright
