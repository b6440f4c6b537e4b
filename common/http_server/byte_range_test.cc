// SPDX-License-Identifier: Apache-2.0
#include "common/http_server/byte_range.h"

#include <tuple>

#include <gtest/gtest.h>

namespace meshwright {
namespace {

using Kind = ByteRange::Kind;

TEST(ByteRangeTest, IsWhatTheRfcSays) {
  struct Case {
    const char* header;
    Kind kind;
    int64_t first;
    int64_t count;
  };
  const Case cases[] = {
      {"", Kind::kWhole, 0, 100},
      {"bytes=0-99", Kind::kPart, 0, 100},
      {"bytes=0-0", Kind::kPart, 0, 1},
      {"bytes=10-", Kind::kPart, 10, 90},
      {"bytes=99-1000", Kind::kPart, 99, 1},
      {"bytes=-7", Kind::kPart, 93, 7},
      {"bytes=-1000", Kind::kPart, 0, 100},
      {"bytes=100-", Kind::kUnsatisfiable, 0, 0},
      {"bytes=100-200", Kind::kUnsatisfiable, 0, 0},
      {"bytes=-0", Kind::kUnsatisfiable, 0, 0},
      // Not one range that can be understood: all of it.
      {"bytes=9-3", Kind::kWhole, 0, 100},
      {"bytes=0-1,5-6", Kind::kWhole, 0, 100},
      {"bytes=-", Kind::kWhole, 0, 100},
      {"bytes=a-b", Kind::kWhole, 0, 100},
      {"bytes=--1", Kind::kWhole, 0, 100},
      {"bytes=1-2-3", Kind::kWhole, 0, 100},
      {"bytes=99999999999999999999-", Kind::kWhole, 0, 100},
      {"lines=1-2", Kind::kWhole, 0, 100},
  };
  for (const Case& c : cases) {
    const ByteRange range = ParseByteRange(c.header, 100);
    EXPECT_EQ(range.kind, c.kind) << c.header;
    if (c.kind != Kind::kUnsatisfiable) {
      EXPECT_EQ(std::tie(range.first, range.count), std::tie(c.first, c.count)) << c.header;
    }
  }
  EXPECT_EQ(ParseByteRange("bytes=0-", 0).kind, Kind::kUnsatisfiable);
  EXPECT_EQ(ParseByteRange("bytes=-5", 0).kind, Kind::kUnsatisfiable);
}

}  // namespace
}  // namespace meshwright
