// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/formats/mesh_format.h"

#include <algorithm>
#include <filesystem>

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <nlohmann/json.hpp>

#include "common/base/status_macros.h"
#include "common/json/json_text.h"
#include "common/mesh/formats/glb.h"
#include "common/mesh/formats/las.h"
#include "common/mesh/formats/obj.h"
#include "common/mesh/formats/stl.h"
#include "common/mesh/formats/tileset.h"

namespace meshwright {
namespace {

absl::Status WritePlyRows(const MeshRows& mesh, const std::string& path, const MeshWriteOptions& /*options*/) {
  constexpr size_t kRowsAtOnce = 1 << 14;
  const PlyAttributes attributes = mesh.attributes();
  MW_ASSIGN_OR_RETURN(PlyStreamWriter writer, PlyStreamWriter::Create(path, attributes));
  for (size_t begin = 0; begin < mesh.vertices(); begin += kRowsAtOnce) {
    TriangleMesh part;
    part.offset = attributes.offset;
    for (size_t v = begin; v < std::min(mesh.vertices(), begin + kRowsAtOnce); ++v) {
      part.positions.push_back(mesh.Position(v));
      if (attributes.normals) part.normals.push_back(mesh.Normal(v));
      if (attributes.colors) part.colors.push_back(mesh.Color(v));
      if (attributes.quality) part.quality.push_back(mesh.Quality(v));
      if (attributes.cameras) part.cameras.push_back(mesh.Camera(v));
    }
    MW_RETURN_IF_ERROR(writer.Append(part));
  }
  std::vector<std::array<uint32_t, 3>> faces;
  for (size_t begin = 0; begin < mesh.faces(); begin += kRowsAtOnce) {
    faces.clear();
    for (size_t f = begin; f < std::min(mesh.faces(), begin + kRowsAtOnce); ++f) faces.push_back(mesh.Face(f));
    MW_RETURN_IF_ERROR(writer.AppendFaces(faces));
  }
  return writer.Commit();
}

// Of a format without choices.
template <absl::Status (*write)(const MeshRows& mesh, const std::string& path)>
absl::Status Write(const MeshRows& mesh, const std::string& path, const MeshWriteOptions& /*options*/) {
  return write(mesh, path);
}

absl::Status WriteGlbAs(const MeshRows& mesh, const std::string& path, const MeshWriteOptions& options) {
  return options.compressed ? WriteCompressedGlb(mesh, path) : WriteGlb(mesh, path);
}

absl::Status WriteTilesetAs(const MeshRows& mesh, const std::string& path, const MeshWriteOptions& options) {
  return WriteTileset(mesh, path, {.compressed = options.compressed});
}

// "ply, glb, ...".
std::string NamesOfSingleFiles() {
  std::vector<std::string> names;
  for (const MeshFormat& format : MeshFormats()) {
    if (!format.has_folder) names.emplace_back(format.name);
  }
  return absl::StrJoin(names, ", ");
}

}  // namespace

const std::vector<MeshFormat>& MeshFormats() {
  static const auto* const formats = new std::vector<MeshFormat>{
      {"ply", ".ply", "model/ply", "PLY", "every attribute", WritePlyRows},
      {.name = "glb",
       .ending = ".glb",
       .media_type = "model/gltf-binary",
       .title = "GLB (binary glTF 2.0)",
       .note = "for viewers and web pages",
       .write = WriteGlbAs,
       .textured = true,
       .compressible = true},
      {.name = "obj",
       .ending = ".obj",
       .media_type = "model/obj",
       .title = "OBJ",
       .note = "text, for every program",
       .write = Write<WriteObj>,
       .textured = true},
      {"stl", ".stl", "model/stl", "STL (binary)", "triangles alone, for printing and CAD", Write<WriteStl>},
      {"las", ".las", "application/vnd.las", "LAS 1.2 point cloud", "vertices with colours, for GIS", Write<WriteLas>},
      {.name = "3d-tiles",
       .ending = ".json",
       .media_type = "application/json",
       .title = "3D Tiles 1.1",
       .note = "levels of detail, for large meshes on maps and web pages",
       .write = WriteTilesetAs,
       .has_folder = true,
       .compressible = true},
  };
  return *formats;
}

absl::StatusOr<const MeshFormat*> MeshFormatOfPath(const std::string& path) {
  const std::string ending = absl::AsciiStrToLower(std::filesystem::path(path).extension().string());
  for (const MeshFormat& format : MeshFormats()) {
    if (ending == format.ending) return &format;
  }
  return absl::InvalidArgumentError(
      absl::StrCat(path, ": the ending of its name is \"", ending, "\", expected one of ", MeshFormatEndings()));
}

absl::StatusOr<const MeshFormat*> MeshFormatByName(const std::string& name) {
  for (const MeshFormat& format : MeshFormats()) {
    if (name != format.name) continue;
    if (!format.has_folder) return &format;
    return absl::InvalidArgumentError(absl::StrCat(
        "format is \"", name, "\", which is a folder of files: over REST ",
        "tiles/tileset.json below the reconstruction, or meshwright fetch -o DIR/tileset.json; expected one of ",
        NamesOfSingleFiles()));
  }
  return absl::InvalidArgumentError(
      absl::StrCat("format is \"", name.substr(0, 32), "\", expected one of ", NamesOfSingleFiles()));
}

std::string MeshFormatEndings() {
  return absl::StrJoin(MeshFormats(), ", ",
                       [](std::string* out, const MeshFormat& format) { absl::StrAppend(out, format.ending); });
}

bool IsPly(const MeshFormat& format) { return &format == MeshFormats().data(); }

std::string DescribeMeshFormats() {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const MeshFormat& format : MeshFormats()) {
    if (format.has_folder) continue;
    list.push_back({{"name", format.name},
                    {"ending", format.ending},
                    {"mediaType", format.media_type},
                    {"title", format.title},
                    {"note", format.note}});
  }
  nlohmann::ordered_json answer;
  answer["formats"] = std::move(list);
  return JsonText(answer);
}

absl::Status CheckCompressible(const MeshFormat& format, const MeshWriteOptions& options, const std::string& path) {
  if (!options.compressed || format.compressible) return absl::OkStatus();
  std::vector<std::string> endings;
  for (const MeshFormat& other : MeshFormats()) {
    if (other.compressible) endings.emplace_back(other.ending);
  }
  return absl::InvalidArgumentError(
      absl::StrCat(path, ": ", format.title, " is not compressed, expected ", absl::StrJoin(endings, " or ")));
}

absl::Status ConvertPly(const std::string& ply_path, const MeshFormat& format, bool points, const std::string& path,
                        const MeshWriteOptions& options) {
  MW_ASSIGN_OR_RETURN(MeshRows mesh, MeshRows::OpenPly(ply_path));
  if (points) mesh.DropFaces();
  return format.write(mesh, path, options);
}

}  // namespace meshwright
