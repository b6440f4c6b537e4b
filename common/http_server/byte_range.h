// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

namespace meshwright {

// What one range of a Range header (RFC 9110, section 14) means for `size_bytes` bytes.
struct ByteRange {
  enum class Kind { kWhole, kPart, kUnsatisfiable };
  Kind kind = Kind::kWhole;
  int64_t first = 0;
  int64_t count = 0;
};
// Whole when the header is not one range that can be understood, as the RFC asks.
ByteRange ParseByteRange(const std::string& header, int64_t size_bytes);

}  // namespace meshwright
