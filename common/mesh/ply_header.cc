// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/ply_header.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <string_view>
#include <utility>

#include <absl/status/status.h>
#include <absl/strings/escaping.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_split.h>

#include "common/base/check.h"
#include "common/base/status_macros.h"

namespace meshwright::ply {
namespace {

// Longer lines do not occur in headers; noise has them.
constexpr size_t kLongestLine = 4096;
constexpr size_t kShownBytes = 40;
// More of them, comments included, do not occur either; each name is compared with those before.
constexpr int kMostLines = 1000;

std::optional<ScalarType> ParseScalarType(const std::string& name) {
  static constexpr std::pair<std::string_view, ScalarType> kNames[] = {
      {"char", ScalarType::kInt8},      {"int8", ScalarType::kInt8},       {"uchar", ScalarType::kUint8},
      {"uint8", ScalarType::kUint8},    {"short", ScalarType::kInt16},     {"int16", ScalarType::kInt16},
      {"ushort", ScalarType::kUint16},  {"uint16", ScalarType::kUint16},   {"int", ScalarType::kInt32},
      {"int32", ScalarType::kInt32},    {"uint", ScalarType::kUint32},     {"uint32", ScalarType::kUint32},
      {"float", ScalarType::kFloat32},  {"float32", ScalarType::kFloat32}, {"double", ScalarType::kFloat64},
      {"float64", ScalarType::kFloat64}};
  for (const auto& [known, type] : kNames) {
    if (known == name) return type;
  }
  return std::nullopt;
}

// That give back the same double: offsets are round numbers, for people to read.
std::string RoundTripDigits(double value) {
  std::string digits = absl::StrFormat("%.15g", value);
  double read = 0;
  std::from_chars(digits.data(), digits.data() + digits.size(), read);
  return read == value ? digits : absl::StrFormat("%.17g", value);
}

// A piece of foreign text that can be shown on a terminal.
std::string Shown(const std::string& text) { return absl::CHexEscape(text.substr(0, kShownBytes)); }

// One line of the header at a time, without its end; lines end in \n or \r\n.
class Lines {
 public:
  Lines(const std::string& bytes, const std::string& name) : bytes_(bytes), name_(name) {}

  absl::StatusOr<std::string> Next(const std::string& expected) {
    ++number_;
    if (number_ > kMostLines) return Error("one more", absl::StrCat("at most ", kMostLines, " lines"));
    const size_t end = bytes_.find('\n', offset_);
    if (end == std::string::npos || end - offset_ > kLongestLine) {
      return Error(bytes_.substr(offset_, kLongestLine), expected);
    }
    std::string line = bytes_.substr(offset_, end - offset_);
    offset_ = end + 1;
    if (!line.empty() && line.back() == '\r') line.pop_back();
    return line;
  }

  absl::Status Error(const std::string& line, const std::string& expected) const {
    return absl::InvalidArgumentError(
        absl::StrCat(name_, ": PLY header, line ", number_, " is \"", Shown(line), "\", expected ", expected));
  }

  size_t offset() const { return offset_; }

 private:
  const std::string& bytes_;
  const std::string& name_;
  size_t offset_ = 0;
  int number_ = 0;
};

std::optional<Eigen::Vector3d> ParseOffset(const std::vector<std::string>& words) {
  if (words.size() != 5 || words[0] != "comment" || words[1] != "offset") return std::nullopt;
  Eigen::Vector3d offset;
  for (int k = 0; k < 3; ++k) {
    const std::string& word = words[static_cast<size_t>(k) + 2];
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), offset[k]);
    if (error != std::errc() || end != word.data() + word.size() || !std::isfinite(offset[k])) return std::nullopt;
  }
  return offset;
}

absl::StatusOr<Encoding> ParseEncoding(const std::vector<std::string>& words, const Lines& lines,
                                       const std::string& line) {
  if (words.size() == 3 && words[0] == "format" && words[2] == "1.0") {
    if (words[1] == "ascii") return Encoding::kAscii;
    if (words[1] == "binary_little_endian") return Encoding::kBinaryLittleEndian;
    if (words[1] == "binary_big_endian") return Encoding::kBinaryBigEndian;
  }
  return lines.Error(line, "\"format ascii|binary_little_endian|binary_big_endian 1.0\"");
}

absl::StatusOr<Property> ParseProperty(const std::vector<std::string>& words, const Lines& lines,
                                       const std::string& line) {
  const bool is_list = words.size() == 5 && words[1] == "list";
  if (!is_list && words.size() != 3)
    return lines.Error(line, "\"property TYPE NAME\" or \"property list TYPE TYPE NAME\"");
  Property property{.name = words.back(), .is_list = is_list};
  const std::optional<ScalarType> type = ParseScalarType(words[words.size() - 2]);
  const std::optional<ScalarType> count_type = is_list ? ParseScalarType(words[2]) : property.count_type;
  if (!type || !count_type) {
    return lines.Error(line, "a type among char, uchar, short, ushort, int, uint, float, double");
  }
  property.type = *type;
  property.count_type = *count_type;
  return property;
}

}  // namespace

size_t SizeOf(ScalarType type) {
  switch (type) {
    case ScalarType::kInt8:
    case ScalarType::kUint8:
      return 1;
    case ScalarType::kInt16:
    case ScalarType::kUint16:
      return 2;
    case ScalarType::kInt32:
    case ScalarType::kUint32:
    case ScalarType::kFloat32:
      return 4;
    case ScalarType::kFloat64:
      return 8;
  }
  return 0;
}

bool IsFloatingPoint(ScalarType type) { return type == ScalarType::kFloat32 || type == ScalarType::kFloat64; }

int Element::Find(const std::string& property) const {
  for (size_t i = 0; i < properties.size(); ++i) {
    if (properties[i].name == property) return static_cast<int>(i);
  }
  return -1;
}

const Element* Header::Find(const std::string& element) const {
  const auto found =
      std::find_if(elements.begin(), elements.end(), [&](const Element& e) { return e.name == element; });
  return found == elements.end() ? nullptr : &*found;
}

absl::StatusOr<Header> ParseHeader(const std::string& bytes, const std::string& name) {
  Header header;
  Lines lines(bytes, name);
  MW_ASSIGN_OR_RETURN(const std::string magic, lines.Next("\"ply\""));
  if (magic != "ply") return lines.Error(magic, "\"ply\"");
  bool has_encoding = false;
  while (true) {
    MW_ASSIGN_OR_RETURN(const std::string line, lines.Next("a line of the header, up to \"end_header\""));
    const std::vector<std::string> words = absl::StrSplit(line, absl::ByAnyChar(" \t"), absl::SkipEmpty());
    if (const auto offset = ParseOffset(words)) header.world_offset = offset;
    if (words.empty() || words[0] == "comment" || words[0] == "obj_info") continue;
    if (!has_encoding) {
      MW_ASSIGN_OR_RETURN(header.encoding, ParseEncoding(words, lines, line));
      has_encoding = true;
    } else if (words[0] == "element") {
      Element element;
      if (words.size() != 3 || !absl::SimpleAtoi(words[2], &element.count)) {
        return lines.Error(line, "\"element NAME COUNT\"");
      }
      element.name = words[1];
      if (header.Find(element.name) != nullptr) return lines.Error(line, "each element once");
      header.elements.push_back(std::move(element));
    } else if (words[0] == "property") {
      if (header.elements.empty()) return lines.Error(line, "an element before its properties");
      MW_ASSIGN_OR_RETURN(Property property, ParseProperty(words, lines, line));
      Element& element = header.elements.back();
      if (element.Find(property.name) >= 0) return lines.Error(line, "each property of an element once");
      element.properties.push_back(std::move(property));
    } else if (words[0] == "end_header") {
      header.body_offset = lines.offset();
      return header;
    } else {
      return lines.Error(line, "comment, element, property or end_header");
    }
  }
}

std::string FormatHeader(const PlyAttributes& attributes, int64_t vertices, int64_t faces) {
  const std::string counts[] = {absl::StrCat(vertices), absl::StrCat(faces)};
  // Digits that the counts do not need go into the comment: readers differ in how they like numbers padded.
  constexpr size_t kDigits = 38;
  MW_CHECK(counts[0].size() + counts[1].size() <= kDigits);
  const std::string padding(kDigits - counts[0].size() - counts[1].size(), ' ');
  const std::string type = attributes.has_offset() ? "double" : "float";
  std::string header = absl::StrCat("ply\nformat binary_little_endian 1.0\ncomment Meshwright", padding, "\n");
  if (attributes.has_offset()) {
    absl::StrAppend(&header, "comment offset");
    for (const double component : attributes.offset) absl::StrAppend(&header, " ", RoundTripDigits(component));
    absl::StrAppend(&header, "\n");
  }
  absl::StrAppend(&header, "element vertex ", counts[0], "\nproperty ", type, " x\nproperty ", type, " y\nproperty ",
                  type, " z\n");
  if (attributes.normals) absl::StrAppend(&header, "property float nx\nproperty float ny\nproperty float nz\n");
  if (attributes.colors) {
    absl::StrAppend(&header, "property uchar red\nproperty uchar green\nproperty uchar blue\n");
  }
  if (attributes.quality) absl::StrAppend(&header, "property float quality\n");
  if (attributes.cameras) absl::StrAppend(&header, "property int camera_index\n");
  absl::StrAppend(&header, "element face ", counts[1], "\nproperty list uchar uint vertex_indices\nend_header\n");
  return header;
}

}  // namespace meshwright::ply
