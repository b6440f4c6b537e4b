#include "common/mesh/formats/glb.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include <nlohmann/json.hpp>

#include "common/mesh/formats/glb_container.h"
#include "common/mesh/formats/row_writer.h"

namespace meshwright {
namespace {

using nlohmann::json;

constexpr uint64_t kVectorBytes = 3 * sizeof(float);
constexpr uint64_t kColorBytes = 4 * sizeof(uint16_t);

// IEC 61966-2-1.
std::array<uint16_t, 256> LinearFromSrgb() {
  std::array<uint16_t, 256> table = {};
  for (int i = 0; i < 256; ++i) {
    const double c = i / 255.0;
    const double linear = c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
    table[static_cast<size_t>(i)] = static_cast<uint16_t>(std::lround(65535 * linear));
  }
  return table;
}

// The scene with its buffer: positions, normals, colours, corners of faces.
glb::Description Describe(const MeshRows& mesh) {
  glb::Description description = glb::NewDescription();
  json& gltf = description.gltf;
  const uint64_t vertices = mesh.vertices();
  if (vertices == 0) return description;  // glTF knows no empty arrays: a scene without nodes

  json primitive = {{"mode", mesh.faces() == 0 ? glb::kPoints : glb::kTriangles}, {"material", 0}};
  const auto add_vectors = [&] {
    return glb::AddAccessor(vertices, kVectorBytes, glb::kFloat, "VEC3", glb::kArrayBuffer, description);
  };
  const size_t positions = add_vectors();
  const MeshRows::Bounds bounds = mesh.FindBounds();
  gltf["accessors"][positions]["min"] = {bounds.low.x(), bounds.low.y(), bounds.low.z()};
  gltf["accessors"][positions]["max"] = {bounds.high.x(), bounds.high.y(), bounds.high.z()};
  primitive["attributes"]["POSITION"] = positions;
  if (mesh.has_normals()) primitive["attributes"]["NORMAL"] = add_vectors();
  if (mesh.has_colors()) {
    const size_t colors =
        glb::AddAccessor(vertices, kColorBytes, glb::kUnsignedShort, "VEC4", glb::kArrayBuffer, description);
    gltf["accessors"][colors]["normalized"] = true;
    primitive["attributes"]["COLOR_0"] = colors;
  }
  if (mesh.faces() > 0) {
    primitive["indices"] = glb::AddAccessor(3 * mesh.faces(), sizeof(uint32_t), glb::kUnsignedInt, "SCALAR",
                                            glb::kElementArrayBuffer, description);
  }
  gltf["scenes"][0]["nodes"] = {0};
  gltf["nodes"] = {glb::MeshNode(mesh.offset())};
  gltf["meshes"] = {{{"primitives", {primitive}}}};
  gltf["materials"] = {{{"doubleSided", true}, {"extensions", {{"KHR_materials_unlit", json::object()}}}}};
  gltf["extensionsUsed"] = {"KHR_materials_unlit"};
  gltf["buffers"] = {{{"byteLength", description.buffer_bytes}}};
  return description;
}

// glTF wants unit normals; one that has no direction becomes any.
Eigen::Vector3f UnitOrAny(const Eigen::Vector3f& normal) {
  const float length = normal.norm();
  return length > 0 && std::isfinite(length) ? Eigen::Vector3f(normal / length) : Eigen::Vector3f::UnitZ();
}

absl::Status AppendBuffer(const MeshRows& mesh, AtomicFile& file) {
  const size_t vertices = mesh.vertices();
  MW_RETURN_IF_ERROR(AppendRows(
      vertices, [&](size_t i, std::string& out) { AppendVector(mesh.Position(i), out); }, file));
  if (mesh.has_normals()) {
    MW_RETURN_IF_ERROR(AppendRows(
        vertices, [&](size_t i, std::string& out) { AppendVector(UnitOrAny(mesh.Normal(i)), out); }, file));
  }
  if (mesh.has_colors()) {
    const std::array<uint16_t, 256> linear = LinearFromSrgb();
    const auto append = [&](size_t i, std::string& out) {
      for (const uint8_t channel : mesh.Color(i)) AppendLittleEndian(linear[channel], out);
      AppendLittleEndian(std::numeric_limits<uint16_t>::max(), out);
    };
    MW_RETURN_IF_ERROR(AppendRows(vertices, append, file));
  }
  const auto append = [&](size_t i, std::string& out) {
    for (const uint32_t corner : mesh.Face(i)) AppendLittleEndian(corner, out);
  };
  return AppendRows(mesh.faces(), append, file);
}

}  // namespace

absl::Status WriteGlb(const MeshRows& mesh, const std::string& path) {
  MW_ASSIGN_OR_RETURN(const std::string head, glb::Head(Describe(mesh), 0, path));
  MW_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::Create(path));
  MW_RETURN_IF_ERROR(file.Append(head));
  MW_RETURN_IF_ERROR(AppendBuffer(mesh, file));
  return file.Commit();
}

}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
