// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/formats/glb.h"

#include <array>
#include <cstdint>
#include <utility>

#include <nlohmann/json.hpp>

#include "common/mesh/formats/glb_compression.h"
#include "common/mesh/formats/glb_container.h"
#include "common/mesh/formats/glb_values.h"
#include "common/mesh/formats/row_writer.h"

namespace meshwright {
namespace {

using nlohmann::json;

constexpr uint64_t kVectorBytes = 3 * sizeof(float);
constexpr uint64_t kColorBytes = 4 * sizeof(uint16_t);

json UnlitMaterial() { return {{"doubleSided", true}, {"extensions", {{"KHR_materials_unlit", json::object()}}}}; }

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
  gltf["materials"] = {UnlitMaterial()};
  gltf["extensionsUsed"] = {"KHR_materials_unlit"};
  gltf["buffers"] = {{{"byteLength", description.buffer_bytes}}};
  return description;
}

absl::Status AppendBuffer(const MeshRows& mesh, AtomicFile& file) {
  const size_t vertices = mesh.vertices();
  MW_RETURN_IF_ERROR(AppendRows(
      vertices, [&](size_t i, std::string& out) { AppendVector(mesh.Position(i), out); }, file));
  if (mesh.has_normals()) {
    MW_RETURN_IF_ERROR(AppendRows(
        vertices, [&](size_t i, std::string& out) { AppendVector(glb::UnitOrAny(mesh.Normal(i)), out); }, file));
  }
  if (mesh.has_colors()) {
    const std::array<uint16_t, 256> linear = glb::LinearFromSrgb();
    const auto append = [&](size_t i, std::string& out) { glb::AppendLinearColor(mesh.Color(i), linear, out); };
    MW_RETURN_IF_ERROR(AppendRows(vertices, append, file));
  }
  const auto append = [&](size_t i, std::string& out) {
    for (const uint32_t corner : mesh.Face(i)) AppendLittleEndian(corner, out);
  };
  return AppendRows(mesh.faces(), append, file);
}

glb::PrimitiveArrays LoadArrays(const MeshRows& mesh) {
  glb::PrimitiveArrays arrays;
  for (size_t v = 0; v < mesh.vertices(); ++v) {
    arrays.positions.push_back(mesh.Position(v));
    if (mesh.has_normals()) arrays.normals.push_back(mesh.Normal(v));
    if (mesh.has_colors()) arrays.colors.push_back(mesh.Color(v));
  }
  for (size_t f = 0; f < mesh.faces(); ++f) arrays.faces.push_back(mesh.Face(f));
  return arrays;
}

}  // namespace

absl::Status WriteCompressedGlb(const MeshRows& mesh, const std::string& path) {
  if (mesh.vertices() == 0) return WriteGlb(mesh, path);
  const MeshRows::Bounds bounds = mesh.FindBounds();
  const glb::PositionLattice lattice = glb::LatticeFor(bounds.low, bounds.high, mesh.vertices());
  return glb::WriteCompressed(LoadArrays(mesh), lattice, mesh.offset(), path);
}

absl::Status glb::WriteCompressed(PrimitiveArrays arrays, const PositionLattice& lattice, const Eigen::Vector3d& offset,
                                  const std::string& path) {
  const CompressedPrimitive compressed(std::move(arrays), lattice);
  Description description = NewDescription();
  json primitive = compressed.Describe(description);
  primitive["material"] = 0;
  json& gltf = description.gltf;
  gltf["scenes"][0]["nodes"] = {0};
  gltf["nodes"] = {CompressedMeshNode(offset, lattice)};
  gltf["meshes"] = {{{"primitives", {primitive}}}};
  gltf["materials"] = {UnlitMaterial()};
  DescribeCompressedBuffers(description);
  MW_ASSIGN_OR_RETURN(const std::string head, Head(description, 0, path));
  MW_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::Create(path));
  MW_RETURN_IF_ERROR(file.Append(head));
  MW_RETURN_IF_ERROR(file.Append(compressed.bytes()));
  return file.Commit();
}

absl::Status WriteGlb(const MeshRows& mesh, const std::string& path) {
  MW_ASSIGN_OR_RETURN(const std::string head, glb::Head(Describe(mesh), 0, path));
  MW_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::Create(path));
  MW_RETURN_IF_ERROR(file.Append(head));
  MW_RETURN_IF_ERROR(AppendBuffer(mesh, file));
  return file.Commit();
}

}  // namespace meshwright
