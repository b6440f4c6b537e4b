// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/formats/glb_compression.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <meshoptimizer.h>

#include "common/base/check.h"
#include "common/base/little_endian.h"
#include "common/mesh/formats/glb_values.h"
#include "common/mesh/formats/row_writer.h"

namespace meshwright::glb {
namespace {

using nlohmann::json;
using Face = std::array<uint32_t, 3>;

constexpr char kExtension[] = "EXT_meshopt_compression";
constexpr double kLargest = std::numeric_limits<uint16_t>::max();
constexpr size_t kMostVerticesInLattice = 1 << 24;

template <typename T>
void Reorder(const std::vector<unsigned int>& remap, size_t count, std::vector<T>& values) {
  if (values.empty()) return;
  std::vector<T> reordered(count);
  for (size_t i = 0; i < values.size(); ++i) {
    if (remap[i] < count) reordered[remap[i]] = values[i];
  }
  values = std::move(reordered);
}

// Faces that are near each other come one after the other, and vertices in the order of the faces: what compresses
// well.
void ReorderForCompression(PrimitiveArrays& arrays) {
  static_assert(sizeof(Face) == 3 * sizeof(unsigned int));
  if (arrays.faces.empty()) return;
  const size_t vertices = arrays.positions.size();
  unsigned int* const corners = arrays.faces.front().data();
  const size_t count = 3 * arrays.faces.size();
  meshopt_optimizeVertexCache(corners, corners, count, vertices);
  std::vector<unsigned int> remap(vertices);
  const size_t used = meshopt_optimizeVertexFetchRemap(remap.data(), corners, count, vertices);
  meshopt_remapIndexBuffer(corners, corners, count, remap.data());
  Reorder(remap, used, arrays.positions);
  Reorder(remap, used, arrays.normals);
  Reorder(remap, used, arrays.colors);
  Reorder(remap, used, arrays.texture_coordinates);
}

std::string PositionRows(const std::vector<Eigen::Vector3f>& positions, const PositionLattice& lattice,
                         json& accessor) {
  std::string rows;
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::max());
  Eigen::Vector3d high = -low;
  for (const Eigen::Vector3f& x : positions) {
    Eigen::Vector3d value = x.cast<double>();
    if (lattice.step > 0) {
      value = ((value - lattice.origin) / lattice.step).array().round();
      MW_CHECK(value.minCoeff() >= 0 && value.maxCoeff() <= kLargest);
      for (int k = 0; k < 3; ++k) AppendLittleEndian(static_cast<uint16_t>(value[k]), rows);
      AppendLittleEndian(uint16_t{0}, rows);
    } else {
      AppendVector(x, rows);
    }
    low = low.cwiseMin(value);
    high = high.cwiseMax(value);
  }
  accessor = {{"componentType", lattice.step > 0 ? kUnsignedShort : kFloat},
              {"type", "VEC3"},
              {"min", {low.x(), low.y(), low.z()}},
              {"max", {high.x(), high.y(), high.z()}}};
  return rows;
}

std::string NormalRows(const std::vector<Eigen::Vector3f>& normals) {
  constexpr float kUnit = std::numeric_limits<int8_t>::max();
  std::string rows;
  for (const Eigen::Vector3f& normal : normals) {
    const Eigen::Vector3f unit = UnitOrAny(normal);
    for (int k = 0; k < 3; ++k) AppendLittleEndian(static_cast<int8_t>(std::lround(kUnit * unit[k])), rows);
    AppendLittleEndian(int8_t{0}, rows);
  }
  return rows;
}

std::string ColorRows(const std::vector<std::array<uint8_t, 3>>& colors) {
  const std::array<uint16_t, 256> linear = LinearFromSrgb();
  std::string rows;
  for (const auto& color : colors) AppendLinearColor(color, linear, rows);
  return rows;
}

std::string CoordinateRows(const std::vector<Eigen::Vector2f>& coordinates) {
  std::string rows;
  for (const Eigen::Vector2f& uv : coordinates) {
    for (int k = 0; k < 2; ++k) {
      AppendLittleEndian(static_cast<uint16_t>(std::lround(kLargest * std::clamp(double{uv[k]}, 0.0, 1.0))), rows);
    }
  }
  return rows;
}

}  // namespace

PositionLattice LatticeFor(const Eigen::Vector3f& low, const Eigen::Vector3f& high, size_t vertices) {
  const double extent = (high - low).cast<double>().maxCoeff();
  PositionLattice lattice;
  if (vertices > kMostVerticesInLattice) return lattice;
  // One step is left for rounding.
  lattice.step = extent > 0 ? std::exp2(std::ceil(std::log2(extent / (kLargest - 1)))) : 1;
  lattice.origin = (low.cast<double>() / lattice.step).array().floor() * lattice.step;
  return lattice;
}

CompressedPrimitive::CompressedPrimitive(PrimitiveArrays arrays, const PositionLattice& lattice) {
  // The versions that the extension is defined with.
  meshopt_encodeVertexVersion(0);
  meshopt_encodeIndexVersion(1);
  ReorderForCompression(arrays);
  vertices_ = arrays.positions.size();
  json accessor;
  const std::string positions = PositionRows(arrays.positions, lattice, accessor);
  AddVertices("POSITION", positions, std::move(accessor));
  if (!arrays.normals.empty()) {
    AddVertices("NORMAL", NormalRows(arrays.normals),
                {{"componentType", kByte}, {"normalized", true}, {"type", "VEC3"}});
  }
  if (!arrays.colors.empty()) {
    AddVertices("COLOR_0", ColorRows(arrays.colors),
                {{"componentType", kUnsignedShort}, {"normalized", true}, {"type", "VEC4"}});
  }
  if (!arrays.texture_coordinates.empty()) {
    AddVertices("TEXCOORD_0", CoordinateRows(arrays.texture_coordinates),
                {{"componentType", kUnsignedShort}, {"normalized", true}, {"type", "VEC2"}});
  }
  if (!arrays.faces.empty()) AddFaces(arrays.faces);
}

void CompressedPrimitive::AddVertices(const char* attribute, const std::string& rows, json accessor) {
  const size_t stride = rows.size() / vertices_;
  std::string compressed(meshopt_encodeVertexBufferBound(vertices_, stride), '\0');
  auto* const out = reinterpret_cast<unsigned char*>(compressed.data());
  compressed.resize(meshopt_encodeVertexBuffer(out, compressed.size(), rows.data(), vertices_, stride));
  Add({.mode = "ATTRIBUTES",
       .stride = stride,
       .count = vertices_,
       .attribute = attribute,
       .accessor = std::move(accessor)},
      std::move(compressed));
}

void CompressedPrimitive::AddFaces(const std::vector<Face>& faces) {
  const size_t count = 3 * faces.size();
  std::string compressed(meshopt_encodeIndexBufferBound(count, vertices_), '\0');
  auto* const out = reinterpret_cast<unsigned char*>(compressed.data());
  compressed.resize(meshopt_encodeIndexBuffer(out, compressed.size(), faces.front().data(), count));
  // 65535 itself means a restart.
  const bool is_short = vertices_ <= std::numeric_limits<uint16_t>::max();
  Add({.mode = "TRIANGLES",
       .stride = is_short ? sizeof(uint16_t) : sizeof(uint32_t),
       .count = count,
       .attribute = "",
       .accessor = {{"componentType", is_short ? kUnsignedShort : kUnsignedInt}, {"type", "SCALAR"}}},
      std::move(compressed));
}

void CompressedPrimitive::Add(View view, std::string compressed) {
  view.byte_length = compressed.size();
  compressed.resize((compressed.size() + 3) / 4 * 4, '\0');
  views_.push_back(std::move(view));
  bytes_ += compressed;
}

json CompressedPrimitive::Describe(Description& description) const {
  json primitive = {{"mode", kPoints}};
  json& gltf = description.gltf;
  for (const View& view : views_) {
    const uint64_t bytes = uint64_t{view.stride} * view.count;
    json described = {{"buffer", 1}, {"byteOffset", description.decoded_bytes}, {"byteLength", bytes}};
    if (!view.attribute.empty()) described["byteStride"] = view.stride;
    described["target"] = view.attribute.empty() ? kElementArrayBuffer : kArrayBuffer;
    described["extensions"][kExtension] = {{"buffer", 0},
                                           {"byteOffset", description.buffer_bytes},
                                           {"byteLength", view.byte_length},
                                           {"byteStride", view.stride},
                                           {"count", view.count},
                                           {"mode", view.mode}};
    description.buffer_bytes += (view.byte_length + 3) / 4 * 4;
    description.decoded_bytes += (bytes + 3) / 4 * 4;
    json accessor = view.accessor;
    accessor["bufferView"] = gltf["bufferViews"].size();
    accessor["count"] = view.count;
    gltf["bufferViews"].push_back(std::move(described));
    const size_t number = gltf["accessors"].size();
    gltf["accessors"].push_back(std::move(accessor));
    if (!view.attribute.empty()) {
      primitive["attributes"][view.attribute] = number;
    } else {
      primitive["indices"] = number;
      primitive["mode"] = kTriangles;
    }
  }
  return primitive;
}

json CompressedMeshNode(const Eigen::Vector3d& offset, const PositionLattice& lattice) {
  json node = MeshNode(offset);
  if (lattice.step == 0) return node;
  const Eigen::Vector3d x = offset + lattice.origin;
  node["translation"] = {x.x(), -x.y(), -x.z()};
  node["scale"] = {lattice.step, lattice.step, lattice.step};
  return node;
}

void DescribeCompressedBuffers(Description& description) {
  description.gltf["buffers"] = {
      {{"byteLength", description.buffer_bytes}},
      {{"byteLength", description.decoded_bytes}, {"extensions", {{kExtension, {{"fallback", true}}}}}}};
  description.gltf["extensionsUsed"] = {"KHR_materials_unlit", "KHR_mesh_quantization", kExtension};
  description.gltf["extensionsRequired"] = {"KHR_mesh_quantization", kExtension};
}

}  // namespace meshwright::glb
