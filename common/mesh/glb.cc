#include "common/mesh/glb.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include <absl/strings/str_cat.h>
#include <nlohmann/json.hpp>

#include "common/base/check.h"
#include "common/base/files.h"
#include "common/base/little_endian.h"
#include "common/base/status_macros.h"

namespace meshwright {
namespace {

using nlohmann::json;

// Constants of the glTF 2.0 specification.
constexpr uint32_t kMagic = 0x46546C67;      // "glTF"
constexpr uint32_t kJsonChunk = 0x4E4F534A;  // "JSON"
constexpr uint32_t kBinChunk = 0x004E4942;   // "BIN"
constexpr int kUnsignedShort = 5123;
constexpr int kUnsignedInt = 5125;
constexpr int kFloat = 5126;
constexpr int kArrayBuffer = 34962;
constexpr int kElementArrayBuffer = 34963;
constexpr int kPoints = 0;
constexpr int kTriangles = 4;

constexpr uint64_t kVectorBytes = 3 * sizeof(float);
constexpr uint64_t kColorBytes = 4 * sizeof(uint16_t);
constexpr uint64_t kFaceBytes = 3 * sizeof(uint32_t);
constexpr size_t kRowsAtOnce = 1 << 14;

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

// Adds an accessor over the next `count` rows of the buffer and returns its number.
size_t AddAccessor(json& gltf, uint64_t& buffer_bytes, uint64_t count, uint64_t row_bytes, int component,
                   const char* type, int target) {
  gltf["bufferViews"].push_back(
      {{"buffer", 0}, {"byteOffset", buffer_bytes}, {"byteLength", count * row_bytes}, {"target", target}});
  gltf["accessors"].push_back(
      {{"bufferView", gltf["bufferViews"].size() - 1}, {"componentType", component}, {"count", count}, {"type", type}});
  buffer_bytes += count * row_bytes;
  return gltf["accessors"].size() - 1;
}

void AddBounds(const std::vector<Eigen::Vector3f>& positions, json& accessor) {
  Eigen::Vector3f low = positions.front();
  Eigen::Vector3f high = positions.front();
  for (const Eigen::Vector3f& x : positions) {
    low = low.cwiseMin(x);
    high = high.cwiseMax(x);
  }
  accessor["min"] = {low.x(), low.y(), low.z()};
  accessor["max"] = {high.x(), high.y(), high.z()};
}

// The scene, and in `buffer_bytes` the size of its buffer: positions, normals, colours, corners of faces.
json Describe(const TriangleMesh& mesh, uint64_t& buffer_bytes) {
  buffer_bytes = 0;
  json gltf = {
      {"asset", {{"version", "2.0"}, {"generator", "Meshwright"}}}, {"scene", 0}, {"scenes", {json::object()}}};
  const uint64_t vertices = mesh.positions.size();
  if (vertices == 0) return gltf;  // glTF knows no empty arrays: a scene without nodes

  json primitive = {{"mode", mesh.faces.empty() ? kPoints : kTriangles}, {"material", 0}};
  const size_t positions = AddAccessor(gltf, buffer_bytes, vertices, kVectorBytes, kFloat, "VEC3", kArrayBuffer);
  AddBounds(mesh.positions, gltf["accessors"][positions]);
  primitive["attributes"]["POSITION"] = positions;
  if (!mesh.normals.empty()) {
    primitive["attributes"]["NORMAL"] =
        AddAccessor(gltf, buffer_bytes, vertices, kVectorBytes, kFloat, "VEC3", kArrayBuffer);
  }
  if (!mesh.colors.empty()) {
    const size_t colors = AddAccessor(gltf, buffer_bytes, vertices, kColorBytes, kUnsignedShort, "VEC4", kArrayBuffer);
    gltf["accessors"][colors]["normalized"] = true;
    primitive["attributes"]["COLOR_0"] = colors;
  }
  if (!mesh.faces.empty()) {
    primitive["indices"] = AddAccessor(gltf, buffer_bytes, 3 * mesh.faces.size(), sizeof(uint32_t), kUnsignedInt,
                                       "SCALAR", kElementArrayBuffer);
  }
  gltf["scenes"][0]["nodes"] = {0};
  gltf["nodes"] = {{{"mesh", 0}}};
  gltf["meshes"] = {{{"primitives", {primitive}}}};
  gltf["materials"] = {{{"doubleSided", true}, {"extensions", {{"KHR_materials_unlit", json::object()}}}}};
  gltf["extensionsUsed"] = {"KHR_materials_unlit"};
  gltf["buffers"] = {{{"byteLength", buffer_bytes}}};
  return gltf;
}

template <typename Store>
absl::Status AppendRows(size_t count, uint64_t row_bytes, const Store& store, AtomicFile& file) {
  std::vector<char> buffer(std::min(count, kRowsAtOnce) * row_bytes);
  for (size_t begin = 0; begin < count; begin += kRowsAtOnce) {
    const size_t end = std::min(count, begin + kRowsAtOnce);
    char* out = buffer.data();
    for (size_t i = begin; i < end; ++i) out = store(i, out);
    MW_RETURN_IF_ERROR(
        file.Append(absl::MakeConstSpan(reinterpret_cast<const uint8_t*>(buffer.data()), (end - begin) * row_bytes)));
  }
  return absl::OkStatus();
}

char* StoreVector(const Eigen::Vector3f& vector, char* out) {
  for (int k = 0; k < 3; ++k) out = StoreLittleEndian(vector[k], out);
  return out;
}

// glTF wants unit normals; one that has no direction becomes any.
Eigen::Vector3f UnitOrAny(const Eigen::Vector3f& normal) {
  const float length = normal.norm();
  return length > 0 && std::isfinite(length) ? Eigen::Vector3f(normal / length) : Eigen::Vector3f::UnitZ();
}

absl::Status AppendBuffer(const TriangleMesh& mesh, AtomicFile& file) {
  MW_RETURN_IF_ERROR(AppendRows(
      mesh.positions.size(), kVectorBytes, [&](size_t i, char* out) { return StoreVector(mesh.positions[i], out); },
      file));
  MW_RETURN_IF_ERROR(AppendRows(
      mesh.normals.size(), kVectorBytes,
      [&](size_t i, char* out) { return StoreVector(UnitOrAny(mesh.normals[i]), out); }, file));
  const std::array<uint16_t, 256> linear = LinearFromSrgb();
  MW_RETURN_IF_ERROR(AppendRows(
      mesh.colors.size(), kColorBytes,
      [&](size_t i, char* out) {
        for (const uint8_t channel : mesh.colors[i]) out = StoreLittleEndian(linear[channel], out);
        return StoreLittleEndian(std::numeric_limits<uint16_t>::max(), out);
      },
      file));
  return AppendRows(
      mesh.faces.size(), kFaceBytes,
      [&](size_t i, char* out) {
        for (const uint32_t corner : mesh.faces[i]) out = StoreLittleEndian(corner, out);
        return out;
      },
      file);
}

}  // namespace

absl::Status WriteGlb(const TriangleMesh& mesh, const std::string& path) {
  MW_CHECK(mesh.normals.empty() || mesh.normals.size() == mesh.positions.size());
  MW_CHECK(mesh.colors.empty() || mesh.colors.size() == mesh.positions.size());
  uint64_t buffer_bytes = 0;
  std::string description = Describe(mesh, buffer_bytes).dump();
  while (description.size() % 4 != 0) description.push_back(' ');
  constexpr uint64_t kFileHeaderBytes = 12;
  constexpr uint64_t kChunkHeaderBytes = 8;
  const uint64_t length = kFileHeaderBytes + kChunkHeaderBytes + description.size() +
                          (buffer_bytes > 0 ? kChunkHeaderBytes + buffer_bytes : 0);
  if (length > std::numeric_limits<uint32_t>::max()) {
    return absl::OutOfRangeError(absl::StrCat(path, ": would have ", length, " bytes, expected at most ",
                                              std::numeric_limits<uint32_t>::max(), " in the GLB format; write PLY"));
  }
  std::string head;
  for (const uint32_t word :
       {kMagic, uint32_t{2}, static_cast<uint32_t>(length), static_cast<uint32_t>(description.size()), kJsonChunk}) {
    AppendLittleEndian(word, head);
  }
  head += description;
  if (buffer_bytes > 0) {
    AppendLittleEndian(static_cast<uint32_t>(buffer_bytes), head);
    AppendLittleEndian(kBinChunk, head);
  }
  MW_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::Create(path));
  MW_RETURN_IF_ERROR(file.Append(head));
  MW_RETURN_IF_ERROR(AppendBuffer(mesh, file));
  return file.Commit();
}

}  // namespace meshwright
