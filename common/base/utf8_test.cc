// SPDX-License-Identifier: Apache-2.0
#include "common/base/utf8.h"

#include <gtest/gtest.h>

namespace meshwright {
namespace {

TEST(Utf8, TextStaysAsItIs) {
  for (const char* text : {"", "a.png", "caf\u00e9.png", "\u65e5\u672c", "\U0001F5FC", "\u007f\u0080\u07ff\u0800\uffff",
                           "\U00010000\U0010FFFF", "100%"}) {
    EXPECT_TRUE(IsUtf8(text)) << text;
    EXPECT_EQ(ToUtf8(text), text);
  }
}

TEST(Utf8, OtherBytesAreWrittenInHexadecimal) {
  EXPECT_EQ(ToUtf8("caf\xE9.png"), "caf%E9.png");
  EXPECT_EQ(ToUtf8("\xE9"), "%E9");
  EXPECT_EQ(ToUtf8("\xC3\xA9\xC3"), "\u00e9%C3");
  EXPECT_EQ(ToUtf8("\xC0\xAF"), "%C0%AF");                // overlong
  EXPECT_EQ(ToUtf8("\xE0\x80\x80"), "%E0%80%80");         // overlong
  EXPECT_EQ(ToUtf8("\xED\xA0\x80"), "%ED%A0%80");         // half of a surrogate pair
  EXPECT_EQ(ToUtf8("\xF4\x90\x80\x80"), "%F4%90%80%80");  // beyond the last character
}

TEST(Utf8, WhateverTheBytesTheResultIsUtf8) {
  for (int first = 0; first < 256; ++first) {
    for (int second = 0; second < 256; ++second) {
      const std::string text = {'a', static_cast<char>(first), static_cast<char>(second), 'b'};
      EXPECT_TRUE(IsUtf8(ToUtf8(text)));
      EXPECT_EQ(IsUtf8(text), ToUtf8(text) == text);
    }
  }
}

}  // namespace
}  // namespace meshwright
