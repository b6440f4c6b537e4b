// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include <Eigen/Core>
#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

namespace meshwright::glb {

// Constants of the glTF 2.0 specification.
constexpr int kByte = 5120;
constexpr int kUnsignedShort = 5123;
constexpr int kUnsignedInt = 5125;
constexpr int kFloat = 5126;
constexpr int kArrayBuffer = 34962;
constexpr int kElementArrayBuffer = 34963;
constexpr int kPoints = 0;
constexpr int kTriangles = 4;

// A glTF description that grows with the buffer it describes.
struct Description {
  nlohmann::json gltf;
  uint64_t buffer_bytes = 0;
  uint64_t decoded_bytes = 0;  // of the second buffer, which the extension's decoders make of the first
};

// asset, one scene, and nothing in it yet.
Description NewDescription();

// The node that carries the scene's mesh: half a turn about X, from a scene's Y down to glTF's Y up, and the scene's
// offset as its translation (and as it is in extras), so that vertices are floats near zero.
nlohmann::json MeshNode(const Eigen::Vector3d& offset);

// Adds a view of the next bytes of the buffer and returns its number. `target` 0: none.
size_t AddView(uint64_t bytes, int target, Description& description);

// Adds an accessor over the next `count` rows of the buffer and returns its number.
size_t AddAccessor(uint64_t count, uint64_t row_bytes, int component, const char* type, int target,
                   Description& description);

// The bytes before the buffer: file header, JSON chunk, header of the binary chunk. The JSON is padded with blanks to
// `json_bytes` at least. OutOfRange when the file would exceed the format's 4 GiB.
absl::StatusOr<std::string> Head(const Description& description, size_t json_bytes, const std::string& path);

}  // namespace meshwright::glb
