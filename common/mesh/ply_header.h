// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <absl/status/statusor.h>

#include "common/mesh/ply.h"

namespace meshwright::ply {

enum class Encoding { kAscii, kBinaryLittleEndian, kBinaryBigEndian };
enum class ScalarType { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat32, kFloat64 };

// Bytes of one value in a binary file.
size_t SizeOf(ScalarType type);
bool IsFloatingPoint(ScalarType type);

struct Property {
  std::string name;
  ScalarType type = ScalarType::kFloat32;
  bool is_list = false;
  ScalarType count_type = ScalarType::kUint8;  // of a list
};

struct Element {
  std::string name;
  uint64_t count = 0;  // as the file claims; not to be trusted
  std::vector<Property> properties;

  // Position of the property in a row, -1 when there is none.
  int Find(const std::string& property) const;
};

struct Header {
  Encoding encoding = Encoding::kAscii;
  std::vector<Element> elements;
  size_t body_offset = 0;  // first byte behind the header
  // Of "comment offset X Y Z".
  std::optional<Eigen::Vector3d> world_offset = std::nullopt;

  const Element* Find(const std::string& element) const;
};

// InvalidArgument names file, line and what was expected. `name` stands for the file.
absl::StatusOr<Header> ParseHeader(const std::string& bytes, const std::string& name);

// Header of a file of ours. Its length does not depend on the counts, so that it can be written last.
std::string FormatHeader(const PlyAttributes& attributes, int64_t vertices, int64_t faces);

}  // namespace meshwright::ply
