// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/formats/obj.h"

#include <absl/strings/str_cat.h>

#include "common/mesh/formats/obj_text.h"
#include "common/mesh/formats/row_writer.h"

namespace meshwright {
namespace {

void AppendVertex(const MeshRows& mesh, size_t vertex, std::string& text) {
  obj::AppendPosition(mesh.Position(vertex), mesh.offset(), text);
  if (mesh.has_colors()) {
    for (const uint8_t channel : mesh.Color(vertex)) obj::AppendNumber(static_cast<float>(channel) / 255.0F, text);
  }
  text += '\n';
}

void AppendFace(const MeshRows& mesh, size_t face, std::string& text) {
  text += 'f';
  for (const uint32_t corner : mesh.Face(face)) {
    const uint64_t number = uint64_t{corner} + 1;
    absl::StrAppend(&text, " ", number);
    if (mesh.has_normals()) absl::StrAppend(&text, "//", number);
  }
  text += '\n';
}

}  // namespace

absl::Status WriteObj(const MeshRows& mesh, const std::string& path) {
  MW_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::Create(path));
  MW_RETURN_IF_ERROR(file.Append(std::string("# Meshwright\n")));
  MW_RETURN_IF_ERROR(AppendRows(
      mesh.vertices(), [&](size_t vertex, std::string& text) { AppendVertex(mesh, vertex, text); }, file));
  if (mesh.has_normals()) {
    const auto append = [&](size_t vertex, std::string& text) {
      obj::AppendNumbers("vn", mesh.Normal(vertex), text);
      text += '\n';
    };
    MW_RETURN_IF_ERROR(AppendRows(mesh.vertices(), append, file));
  }
  MW_RETURN_IF_ERROR(AppendRows(
      mesh.faces(), [&](size_t face, std::string& text) { AppendFace(mesh, face, text); }, file));
  return file.Commit();
}

}  // namespace meshwright
