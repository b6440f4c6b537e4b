// SPDX-License-Identifier: Apache-2.0
#include "common/http_server/byte_range.h"

#include <algorithm>
#include <vector>

#include <absl/strings/match.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_split.h>

namespace meshwright {
namespace {

bool IsNumber(const std::string& text) {
  return !text.empty() && text.size() <= 18 && text.find_first_not_of("0123456789") == std::string::npos;
}

}  // namespace

ByteRange ParseByteRange(const std::string& header, int64_t size_bytes) {
  constexpr char kUnit[] = "bytes=";
  const ByteRange whole = {ByteRange::Kind::kWhole, 0, size_bytes};
  if (!absl::StartsWith(header, kUnit)) return whole;
  const std::vector<std::string> ends = absl::StrSplit(header.substr(sizeof(kUnit) - 1), '-');
  if (ends.size() != 2) return whole;
  int64_t first = 0;
  int64_t last = 0;
  if (ends[0].empty()) {  // the last so many bytes
    if (!IsNumber(ends[1]) || !absl::SimpleAtoi(ends[1], &last)) return whole;
    if (last == 0 || size_bytes == 0) return {ByteRange::Kind::kUnsatisfiable};
    const int64_t count = std::min(last, size_bytes);
    return {ByteRange::Kind::kPart, size_bytes - count, count};
  }
  if (!IsNumber(ends[0]) || !absl::SimpleAtoi(ends[0], &first)) return whole;
  last = size_bytes - 1;
  if (!ends[1].empty()) {
    if (!IsNumber(ends[1]) || !absl::SimpleAtoi(ends[1], &last) || last < first) return whole;
    last = std::min(last, size_bytes - 1);
  }
  if (first >= size_bytes) return {ByteRange::Kind::kUnsatisfiable};
  return {ByteRange::Kind::kPart, first, last - first + 1};
}

}  // namespace meshwright
