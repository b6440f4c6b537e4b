// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"
#include "common/scene/formats/text_fields.h"

namespace meshwright {

static_assert(std::endian::native == std::endian::little, "the binary files of scenes are little-endian");

// Reads a file's bytes field by field. Errors name the file, the number of the record, the field, and what was
// expected; counts are believed only as far as the file has bytes.
class BinaryFields {
 public:
  BinaryFields(const std::string& bytes, const std::string& file) : bytes_(bytes), place_{file, "record", 0} {}

  const Place& place() const { return place_; }
  void NextRecord() { ++place_.number; }

  template <typename T>
  absl::StatusOr<T> Read(const char* field) {
    if (sizeof(T) > Remaining()) return EndsEarly(field);
    T value{};
    std::memcpy(&value, bytes_.data() + offset_, sizeof(T));
    offset_ += sizeof(T);
    return value;
  }

  absl::StatusOr<double> Number(const char* field) {
    MW_ASSIGN_OR_RETURN(const double value, Read<double>(field));
    if (!std::isfinite(value)) return FieldError(place_, field, absl::StrCat(value), "a finite number");
    return value;
  }

  // A number of things of at least `smallest_bytes` each that follow.
  absl::StatusOr<uint64_t> Count(const char* field, uint64_t smallest_bytes) {
    MW_ASSIGN_OR_RETURN(const uint64_t count, Read<uint64_t>(field));
    const uint64_t room = Remaining() / smallest_bytes;
    if (count > room) {
      return FieldError(place_, field, absl::StrCat(count),
                        absl::StrCat("at most ", room, ", for which the file has bytes"));
    }
    return count;
  }

  // A length of 64 bits and so many bytes.
  absl::StatusOr<std::string> Text(const char* field) {
    constexpr uint64_t kLongest = 64 << 10;
    MW_ASSIGN_OR_RETURN(const uint64_t length, Count(field, 1));
    if (length > kLongest) {
      return FieldError(place_, field, absl::StrCat(length, " bytes"), absl::StrCat("at most ", kLongest));
    }
    std::string value = bytes_.substr(offset_, length);
    offset_ += length;
    return value;
  }

  absl::StatusOr<std::string> NullTerminated(const char* field) {
    const size_t end = bytes_.find('\0', offset_);
    if (end == std::string::npos) return EndsEarly(field);
    std::string value = bytes_.substr(offset_, end - offset_);
    offset_ = end + 1;
    return value;
  }

  // The caller has made sure that there are so many bytes.
  void Skip(uint64_t count) { offset_ += count; }

  absl::Status ExpectEnd() {
    if (Remaining() == 0) return absl::OkStatus();
    return absl::InvalidArgumentError(
        absl::StrCat(place_.ToString(), ": ", Remaining(), " bytes follow the last record; expected none"));
  }

 private:
  size_t Remaining() const { return bytes_.size() - offset_; }
  absl::Status EndsEarly(const char* field) const {
    return absl::InvalidArgumentError(
        absl::StrCat(place_.ToString(), ": ends early after ", bytes_.size(), " bytes; expected ", field));
  }

  const std::string& bytes_;
  Place place_;
  size_t offset_ = 0;
};

}  // namespace meshwright
