// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/formats/glb_container.h"

#include <limits>

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>

#include "common/base/little_endian.h"
#include "common/json/json_text.h"

namespace meshwright::glb {
namespace {

using nlohmann::json;

constexpr uint32_t kMagic = 0x46546C67;      // "glTF"
constexpr uint32_t kJsonChunk = 0x4E4F534A;  // "JSON"
constexpr uint32_t kBinChunk = 0x004E4942;   // "BIN"

}  // namespace

Description NewDescription() {
  Description description;
  description.gltf = {
      {"asset", {{"version", "2.0"}, {"generator", "Meshwright"}}}, {"scene", 0}, {"scenes", {json::object()}}};
  return description;
}

json MeshNode(const Eigen::Vector3d& offset) {
  json node = {{"mesh", 0}, {"rotation", {1, 0, 0, 0}}};
  if (!offset.isZero(0)) {
    node["translation"] = {offset.x(), -offset.y(), -offset.z()};
    node["extras"] = {{"offset", {offset.x(), offset.y(), offset.z()}}};
  }
  return node;
}

size_t AddView(uint64_t bytes, int target, Description& description) {
  json view = {{"buffer", 0}, {"byteOffset", description.buffer_bytes}, {"byteLength", bytes}};
  if (target != 0) view["target"] = target;
  description.gltf["bufferViews"].push_back(std::move(view));
  description.buffer_bytes += bytes;
  return description.gltf["bufferViews"].size() - 1;
}

size_t AddAccessor(uint64_t count, uint64_t row_bytes, int component, const char* type, int target,
                   Description& description) {
  const size_t view = AddView(count * row_bytes, target, description);
  json& accessors = description.gltf["accessors"];
  accessors.push_back({{"bufferView", view}, {"componentType", component}, {"count", count}, {"type", type}});
  return accessors.size() - 1;
}

absl::StatusOr<std::string> Head(const Description& description, size_t json_bytes, const std::string& path) {
  std::string text = JsonText(description.gltf);
  while (text.size() < json_bytes || text.size() % 4 != 0) text.push_back(' ');
  constexpr uint64_t kFileHeaderBytes = 12;
  constexpr uint64_t kChunkHeaderBytes = 8;
  const uint64_t buffer = description.buffer_bytes;
  const uint64_t length =
      kFileHeaderBytes + kChunkHeaderBytes + text.size() + (buffer > 0 ? kChunkHeaderBytes + buffer : 0);
  if (length > std::numeric_limits<uint32_t>::max()) {
    return absl::OutOfRangeError(absl::StrCat(path, ": would have ", length, " bytes, expected at most ",
                                              std::numeric_limits<uint32_t>::max(), " in the GLB format; write PLY"));
  }
  std::string head;
  for (const uint32_t word :
       {kMagic, uint32_t{2}, static_cast<uint32_t>(length), static_cast<uint32_t>(text.size()), kJsonChunk}) {
    AppendLittleEndian(word, head);
  }
  head += text;
  if (buffer > 0) {
    AppendLittleEndian(static_cast<uint32_t>(buffer), head);
    AppendLittleEndian(kBinChunk, head);
  }
  return head;
}

}  // namespace meshwright::glb
