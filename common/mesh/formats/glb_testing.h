// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include <Eigen/Core>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "common/base/little_endian.h"

namespace meshwright {

struct Glb {
  nlohmann::json description;
  std::string buffer;
};

// Splits a file into its chunks and holds it to the rules of the container.
inline Glb SplitGlb(const std::string& bytes) {
  Glb glb;
  const auto word = [&](size_t offset) { return LoadLittleEndian<uint32_t>(bytes.data() + offset); };
  EXPECT_EQ(bytes.substr(0, 4), "glTF");
  EXPECT_EQ(word(4), 2U);
  EXPECT_EQ(word(8), bytes.size());
  EXPECT_EQ(bytes.substr(16, 4), "JSON");
  const size_t json_bytes = word(12);
  EXPECT_EQ(json_bytes % 4, 0U);
  glb.description = nlohmann::json::parse(bytes.substr(20, json_bytes));
  const size_t chunk = 20 + json_bytes;
  if (chunk == bytes.size()) return glb;
  EXPECT_EQ(bytes.substr(chunk + 4, 4), std::string("BIN\0", 4));
  EXPECT_EQ(chunk + 8 + word(chunk), bytes.size());
  glb.buffer = bytes.substr(chunk + 8);
  EXPECT_EQ(glb.description["buffers"][0]["byteLength"], glb.buffer.size());
  return glb;
}

// First byte of row `row` of an accessor whose rows have `row_bytes` bytes.
inline const char* Row(const Glb& glb, const nlohmann::json& accessor, size_t row, size_t row_bytes) {
  const nlohmann::json& view = glb.description["bufferViews"][accessor["bufferView"].get<size_t>()];
  EXPECT_EQ(view["byteLength"], accessor["count"].get<size_t>() * row_bytes);
  EXPECT_EQ(view["byteOffset"].get<size_t>() % 4, 0U);
  const size_t offset = view["byteOffset"].get<size_t>() + row * row_bytes;
  EXPECT_LE(offset + row_bytes, glb.buffer.size());
  return glb.buffer.data() + offset;
}

inline Eigen::Vector3f VectorAt(const char* bytes) {
  return {LoadLittleEndian<float>(bytes), LoadLittleEndian<float>(bytes + 4), LoadLittleEndian<float>(bytes + 8)};
}

}  // namespace meshwright
