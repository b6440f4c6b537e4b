// SPDX-License-Identifier: Apache-2.0
#include "common/base/utf8.h"

#include <cstddef>
#include <cstdint>

namespace meshwright {
namespace {

// Length in bytes of the character that `text` begins with, 0 if it is none (RFC 3629: neither overlong nor a half of a
// surrogate pair nor beyond U+10FFFF).
size_t CharacterLength(std::string_view text) {
  const auto byte = [&](size_t i) { return static_cast<uint8_t>(text[i]); };
  const uint8_t first = byte(0);
  if (first < 0x80) return 1;
  if (first < 0xC2 || first > 0xF4) return 0;
  const size_t length = first < 0xE0 ? 2 : first < 0xF0 ? 3 : 4;
  if (text.size() < length) return 0;
  for (size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xC0) != 0x80) return 0;
  }
  const bool overlong = (first == 0xE0 && byte(1) < 0xA0) || (first == 0xF0 && byte(1) < 0x90);
  const bool surrogate = first == 0xED && byte(1) > 0x9F;
  const bool too_large = first == 0xF4 && byte(1) > 0x8F;
  return overlong || surrogate || too_large ? 0 : length;
}

}  // namespace

bool IsUtf8(std::string_view text) {
  while (!text.empty()) {
    const size_t length = CharacterLength(text);
    if (length == 0) return false;
    text.remove_prefix(length);
  }
  return true;
}

std::string ToUtf8(std::string_view text) {
  constexpr char kDigits[] = "0123456789ABCDEF";
  std::string utf8;
  while (!text.empty()) {
    const size_t length = CharacterLength(text);
    if (length == 0) {
      const auto byte = static_cast<uint8_t>(text.front());
      utf8 += {'%', kDigits[byte >> 4], kDigits[byte & 0xF]};
      text.remove_prefix(1);
    } else {
      utf8 += text.substr(0, length);
      text.remove_prefix(length);
    }
  }
  return utf8;
}

}  // namespace meshwright
