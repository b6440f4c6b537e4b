// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <bit>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <string>
#include <system_error>

#include <absl/strings/escaping.h>
#include <absl/strings/str_cat.h>

#include "common/base/little_endian.h"
#include "common/mesh/ply_header.h"

namespace meshwright::ply {

// The values of a body one after the other. A double holds every value of every PLY type exactly. Next() and Skip() say
// false where the file ends or has no number; DescribeFault() then tells which.
class BinaryValues {
 public:
  BinaryValues(const std::string& bytes, size_t offset, std::endian order)
      : begin_(bytes.data()), next_(begin_ + offset), end_(begin_ + bytes.size()), order_(order) {}

  // Bytes that a value needs at least.
  static size_t SmallestSize(ScalarType type) { return SizeOf(type); }
  size_t bytes_left() const { return static_cast<size_t>(end_ - next_); }

  bool Next(ScalarType type, double& value) {
    const size_t size = SizeOf(type);
    if (bytes_left() < size) return false;
    value = Load(type);
    next_ += size;
    return true;
  }

  bool Skip(ScalarType type, uint64_t count) {
    const size_t size = SizeOf(type);
    if (bytes_left() / size < count) return false;
    next_ += count * size;
    return true;
  }

  std::string DescribeFault() const {
    return absl::StrCat("the file ends at byte ", end_ - begin_, ", expected more values");
  }

 private:
  double Load(ScalarType type) const {
    switch (type) {
      case ScalarType::kInt8:
        return LoadScalar<int8_t>(next_, order_);
      case ScalarType::kUint8:
        return LoadScalar<uint8_t>(next_, order_);
      case ScalarType::kInt16:
        return LoadScalar<int16_t>(next_, order_);
      case ScalarType::kUint16:
        return LoadScalar<uint16_t>(next_, order_);
      case ScalarType::kInt32:
        return LoadScalar<int32_t>(next_, order_);
      case ScalarType::kUint32:
        return LoadScalar<uint32_t>(next_, order_);
      case ScalarType::kFloat32:
        return LoadScalar<float>(next_, order_);
      case ScalarType::kFloat64:
        return LoadScalar<double>(next_, order_);
    }
    return 0;
  }

  const char* begin_;
  const char* next_;
  const char* end_;
  std::endian order_;
};

// The same for numbers written as text. Their types are not looked at.
class AsciiValues {
 public:
  AsciiValues(const std::string& bytes, size_t offset)
      : begin_(bytes.data()), next_(begin_ + offset), end_(begin_ + bytes.size()) {}

  static size_t SmallestSize(ScalarType) { return 1; }
  size_t bytes_left() const { return static_cast<size_t>(end_ - next_); }

  bool Next(ScalarType, double& value) {
    while (next_ < end_ && IsSpace(*next_)) ++next_;
    const char* first = next_ < end_ && *next_ == '+' ? next_ + 1 : next_;
    const auto [last, error] = std::from_chars(first, end_, value);
    if (error != std::errc() || (last < end_ && !IsSpace(*last))) return false;
    next_ = last;
    return true;
  }

  bool Skip(ScalarType type, uint64_t count) {
    double value = 0;
    for (uint64_t i = 0; i < count; ++i) {
      if (!Next(type, value)) return false;
    }
    return true;
  }

  std::string DescribeFault() const {
    if (next_ == end_) return "the file ends, expected more values";
    const std::string word(next_, std::find_if(next_, std::min(end_, next_ + 40), IsSpace));
    return absl::StrCat("\"", absl::CHexEscape(word), "\" at byte ", next_ - begin_, ", expected a number");
  }

 private:
  static bool IsSpace(char c) { return c == ' ' || c == '\n' || c == '\r' || c == '\t'; }

  const char* begin_;
  const char* next_;
  const char* end_;
};

}  // namespace meshwright::ply
