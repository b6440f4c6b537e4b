// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/strings/str_cat.h>

#include "common/base/files.h"
#include "common/base/status_macros.h"
#include "common/mesh/ply.h"
#include "common/mesh/ply_header.h"
#include "common/mesh/ply_values.h"

namespace meshwright {
namespace {

using ply::AsciiValues;
using ply::BinaryValues;
using ply::Element;
using ply::Encoding;
using ply::Header;
using ply::Property;
using ply::ScalarType;

absl::Status BadValue(const std::string& file, const std::string& element, uint64_t row, const std::string& property,
                      const std::string& what) {
  return absl::InvalidArgumentError(absl::StrCat(file, ": ", element, " ", row, ", ", property, ": ", what));
}

// Refuses counts for which the file cannot have the bytes, before anything is allocated for them.
template <typename Values>
absl::Status CheckCount(const std::string& file, const Element& element, const Values& values) {
  size_t smallest_row = 0;
  for (const Property& property : element.properties) {
    smallest_row += Values::SmallestSize(property.is_list ? property.count_type : property.type);
  }
  if (smallest_row > 0 && element.count > values.bytes_left() / smallest_row) {
    return absl::InvalidArgumentError(absl::StrCat(file, ": element ", element.name, ": count is ", element.count,
                                                   ", expected at most ", values.bytes_left() / smallest_row,
                                                   ", for which there are bytes in the file"));
  }
  return absl::OkStatus();
}

// Length of the list that comes next.
template <typename Values>
absl::StatusOr<uint64_t> ReadListLength(const std::string& file, const Element& element, uint64_t row,
                                        const Property& property, Values& values) {
  double length = 0;
  if (!values.Next(property.count_type, length)) {
    return BadValue(file, element.name, row, property.name, values.DescribeFault());
  }
  const uint64_t most = values.bytes_left() / Values::SmallestSize(property.type);
  if (!(length >= 0 && length <= static_cast<double>(most)) || length != std::floor(length)) {
    return BadValue(file, element.name, row, property.name,
                    absl::StrCat("length of the list is ", length, ", expected an integer in 0..", most));
  }
  return static_cast<uint64_t>(length);
}

template <typename Values>
absl::Status SkipElement(const std::string& file, const Element& element, Values& values) {
  if (element.properties.empty()) return absl::OkStatus();
  MW_RETURN_IF_ERROR(CheckCount(file, element, values));
  for (uint64_t row = 0; row < element.count; ++row) {
    for (const Property& property : element.properties) {
      uint64_t count = 1;
      if (property.is_list) {
        MW_ASSIGN_OR_RETURN(count, ReadListLength(file, element, row, property, values));
      }
      if (!values.Skip(property.type, count)) {
        return BadValue(file, element.name, row, property.name, values.DescribeFault());
      }
    }
  }
  return absl::OkStatus();
}

// Where the properties that we know stand in a row of element vertex; -1 for absent.
struct VertexLayout {
  std::array<int, 3> position = {-1, -1, -1};
  std::array<int, 3> normal = {-1, -1, -1};
  std::array<int, 3> color = {-1, -1, -1};
  int quality = -1;
  int camera = -1;
};

absl::StatusOr<VertexLayout> FindVertexLayout(const std::string& file, const Element& element) {
  const auto find = [&](const char* name) {
    const int column = element.Find(name);
    return column >= 0 && !element.properties[static_cast<size_t>(column)].is_list ? column : -1;
  };
  const auto find_three = [&](const char* a, const char* b, const char* c) {
    const std::array<int, 3> columns = {find(a), find(b), find(c)};
    const bool all = columns[0] >= 0 && columns[1] >= 0 && columns[2] >= 0;
    return all ? columns : std::array<int, 3>{-1, -1, -1};
  };
  VertexLayout layout;
  layout.position = find_three("x", "y", "z");
  layout.normal = find_three("nx", "ny", "nz");
  layout.color = find_three("red", "green", "blue");
  layout.quality = find("quality") >= 0 ? find("quality") : find("confidence");
  layout.camera = find("camera_index");
  if (layout.position[0] < 0) {
    return absl::InvalidArgumentError(
        absl::StrCat(file, ": element vertex lacks a property, expected scalar x, y and z"));
  }
  return layout;
}

// What positions are read less. Floats have no digits to be saved; doubles have, where they are far from zero.
Eigen::Vector3d OffsetFor(const Element& element, const VertexLayout& layout,
                          const std::optional<Eigen::Vector3d>& told, const std::vector<double>& first_row) {
  Eigen::Vector3d first;
  for (int k = 0; k < 3; ++k) {
    const auto column = static_cast<size_t>(layout.position[static_cast<size_t>(k)]);
    if (element.properties[column].type != ScalarType::kFloat64) return Eigen::Vector3d::Zero();
    first[k] = first_row[column];
  }
  if (told.has_value()) return *told;
  constexpr double kFar = 1e5;
  constexpr double kRounding = 100;
  if (!first.allFinite() || first.cwiseAbs().maxCoeff() < kFar) return Eigen::Vector3d::Zero();
  return (first / kRounding).array().round().matrix() * kRounding;
}

uint8_t ColorFrom(double value, ScalarType type) {
  const double scaled = ply::IsFloatingPoint(type) ? value * 255 : value;
  if (!(scaled > 0)) return 0;
  return static_cast<uint8_t>(std::min(scaled + 0.5, 255.0));
}

float FiniteOrZero(double value) {
  const auto narrow = static_cast<float>(value);
  return std::isfinite(narrow) ? narrow : 0.0F;
}

// Appends the vertex whose values are in `row` (one per property; lists have no value).
absl::Status AppendVertex(const std::string& file, const Element& element, const VertexLayout& layout, uint64_t index,
                          const std::vector<double>& row, TriangleMesh& mesh) {
  const auto value = [&](int column) { return row[static_cast<size_t>(column)]; };
  Eigen::Vector3f position;
  for (int k = 0; k < 3; ++k) {
    const double coordinate = value(layout.position[k]);
    position[k] = static_cast<float>(coordinate - mesh.offset[k]);
    if (!std::isfinite(position[k])) {
      return BadValue(file, element.name, index, std::string(1, "xyz"[k]),
                      absl::StrCat(coordinate, ", expected a finite number within the range of a float"));
    }
  }
  mesh.positions.push_back(position);
  if (layout.normal[0] >= 0) {
    mesh.normals.emplace_back(FiniteOrZero(value(layout.normal[0])), FiniteOrZero(value(layout.normal[1])),
                              FiniteOrZero(value(layout.normal[2])));
  }
  if (layout.color[0] >= 0) {
    std::array<uint8_t, 3> color = {0, 0, 0};
    for (int k = 0; k < 3; ++k) {
      color[k] = ColorFrom(value(layout.color[k]), element.properties[static_cast<size_t>(layout.color[k])].type);
    }
    mesh.colors.push_back(color);
  }
  if (layout.quality >= 0) mesh.quality.push_back(FiniteOrZero(value(layout.quality)));
  if (layout.camera >= 0) {
    const double camera = value(layout.camera);
    using Limits = std::numeric_limits<CameraIndex>;
    if (!(camera >= Limits::min() && camera <= Limits::max()) || camera != std::floor(camera)) {
      return BadValue(file, element.name, index, "camera_index",
                      absl::StrCat(camera, ", expected an integer of 32 bits"));
    }
    mesh.cameras.push_back(static_cast<CameraIndex>(camera));
  }
  return absl::OkStatus();
}

template <typename Values>
absl::Status ReadVertices(const std::string& file, const Element& element, const std::optional<Eigen::Vector3d>& offset,
                          Values& values, TriangleMesh& mesh) {
  MW_ASSIGN_OR_RETURN(const VertexLayout layout, FindVertexLayout(file, element));
  MW_RETURN_IF_ERROR(CheckCount(file, element, values));
  if (element.count > std::numeric_limits<uint32_t>::max()) {
    return absl::InvalidArgumentError(absl::StrCat(file, ": element vertex: count is ", element.count,
                                                   ", expected at most ", std::numeric_limits<uint32_t>::max()));
  }
  mesh.positions.reserve(element.count);
  if (layout.normal[0] >= 0) mesh.normals.reserve(element.count);
  if (layout.color[0] >= 0) mesh.colors.reserve(element.count);
  if (layout.quality >= 0) mesh.quality.reserve(element.count);
  if (layout.camera >= 0) mesh.cameras.reserve(element.count);
  std::vector<double> row(element.properties.size(), 0.0);
  for (uint64_t index = 0; index < element.count; ++index) {
    for (size_t column = 0; column < row.size(); ++column) {
      const Property& property = element.properties[column];
      bool read = false;
      if (property.is_list) {
        MW_ASSIGN_OR_RETURN(const uint64_t length, ReadListLength(file, element, index, property, values));
        read = values.Skip(property.type, length);
      } else {
        read = values.Next(property.type, row[column]);
      }
      if (!read) return BadValue(file, element.name, index, property.name, values.DescribeFault());
    }
    if (index == 0) mesh.offset = OffsetFor(element, layout, offset, row);
    MW_RETURN_IF_ERROR(AppendVertex(file, element, layout, index, row, mesh));
  }
  return absl::OkStatus();
}

// Reads one polygon as a fan around its first corner.
template <typename Values>
absl::Status ReadPolygon(const std::string& file, const Element& element, uint64_t row, const Property& property,
                         uint64_t vertices, Values& values, TriangleMesh& mesh) {
  MW_ASSIGN_OR_RETURN(const uint64_t corners, ReadListLength(file, element, row, property, values));
  uint32_t first = 0;
  uint32_t previous = 0;
  for (uint64_t corner = 0; corner < corners; ++corner) {
    double value = 0;
    if (!values.Next(property.type, value)) {
      return BadValue(file, element.name, row, property.name, values.DescribeFault());
    }
    if (!(value >= 0 && value < static_cast<double>(vertices)) || value != std::floor(value)) {
      return BadValue(file, element.name, row, property.name,
                      absl::StrCat("index ", value, ", expected an integer below the number of vertices, ", vertices));
    }
    const auto index = static_cast<uint32_t>(value);
    if (corner == 0) first = index;
    if (corner >= 2) mesh.faces.push_back({first, previous, index});
    previous = index;
  }
  return absl::OkStatus();
}

template <typename Values>
absl::Status ReadFaces(const std::string& file, const Element& element, uint64_t vertices, Values& values,
                       TriangleMesh& mesh) {
  int indices = element.Find("vertex_indices");
  if (indices < 0) indices = element.Find("vertex_index");
  if (indices < 0 || !element.properties[static_cast<size_t>(indices)].is_list) {
    return absl::InvalidArgumentError(
        absl::StrCat(file, ": element face lacks a property, expected list vertex_indices or vertex_index"));
  }
  MW_RETURN_IF_ERROR(CheckCount(file, element, values));
  const Property& list = element.properties[static_cast<size_t>(indices)];
  const size_t triangle_bytes = Values::SmallestSize(list.count_type) + 3 * Values::SmallestSize(list.type);
  mesh.faces.reserve(std::min<uint64_t>(element.count, values.bytes_left() / triangle_bytes));
  for (uint64_t row = 0; row < element.count; ++row) {
    for (const Property& property : element.properties) {
      if (&property == &list) {
        MW_RETURN_IF_ERROR(ReadPolygon(file, element, row, property, vertices, values, mesh));
        continue;
      }
      uint64_t count = 1;
      if (property.is_list) {
        MW_ASSIGN_OR_RETURN(count, ReadListLength(file, element, row, property, values));
      }
      if (!values.Skip(property.type, count)) {
        return BadValue(file, element.name, row, property.name, values.DescribeFault());
      }
    }
  }
  return absl::OkStatus();
}

template <typename Values>
absl::StatusOr<TriangleMesh> ReadBody(const std::string& file, const Header& header, Values values) {
  const Element* vertex = header.Find("vertex");
  if (vertex == nullptr) {
    return absl::InvalidArgumentError(absl::StrCat(file, ": PLY header lacks element vertex, expected one"));
  }
  TriangleMesh mesh;
  for (const Element& element : header.elements) {
    if (&element == vertex) {
      MW_RETURN_IF_ERROR(ReadVertices(file, element, header.world_offset, values, mesh));
    } else if (element.name == "face" && element.count > 0) {
      MW_RETURN_IF_ERROR(ReadFaces(file, element, vertex->count, values, mesh));
    } else {
      MW_RETURN_IF_ERROR(SkipElement(file, element, values));
    }
  }
  return mesh;
}

}  // namespace

absl::StatusOr<TriangleMesh> ParsePly(const std::string& bytes, const std::string& name) {
  MW_ASSIGN_OR_RETURN(const Header header, ply::ParseHeader(bytes, name));
  switch (header.encoding) {
    case Encoding::kAscii:
      return ReadBody(name, header, AsciiValues(bytes, header.body_offset));
    case Encoding::kBinaryLittleEndian:
      return ReadBody(name, header, BinaryValues(bytes, header.body_offset, std::endian::little));
    case Encoding::kBinaryBigEndian:
      return ReadBody(name, header, BinaryValues(bytes, header.body_offset, std::endian::big));
  }
  return absl::InternalError("unreachable");
}

absl::StatusOr<TriangleMesh> ReadPly(const std::string& path) {
  MW_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path));
  return ParsePly(bytes, path);
}

}  // namespace meshwright
