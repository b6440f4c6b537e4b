#include "coordinator/rest/downloads.h"

#include <cstdlib>
#include <filesystem>
#include <tuple>

#include <gtest/gtest.h>

#include "common/base/check.h"
#include "common/base/files.h"

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

TEST(DerivedFilesTest, MakesEachOnceAndKeepsTheLastOnes) {
  std::string folder = testing::TempDir() + "derived_XXXXXX";
  MW_CHECK(mkdtemp(folder.data()) != nullptr);
  const auto files = *DerivedFiles::Open(folder + "/derived");
  int made = 0;
  const auto get = [&](const std::string& key) {
    return *files->Get(key, [&](const std::string& path) {
      ++made;
      return WriteFileAtomically(path, "of " + key);
    });
  };
  const auto first = get("0");
  EXPECT_EQ(get("0")->size_bytes(), 4);
  EXPECT_EQ(made, 1);
  for (int key = 1; key < 100; ++key) get(std::to_string(key));
  EXPECT_EQ(made, 100);
  EXPECT_LE(std::distance(std::filesystem::directory_iterator(folder + "/derived"), {}), 8);
  // Who reads one goes on reading it.
  char bytes[4];
  EXPECT_EQ(*first->Read(0, bytes, sizeof(bytes)), sizeof(bytes));
  EXPECT_EQ(std::string(bytes, 4), "of 0");
  EXPECT_FALSE(first->Read(4, bytes, sizeof(bytes)).ok());
  // An error is told, and tried again.
  EXPECT_TRUE(absl::IsDataLoss(files->Get("x", [](const std::string&) { return absl::DataLossError("no"); }).status()));
  EXPECT_EQ(get("x")->size_bytes(), 4);
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
