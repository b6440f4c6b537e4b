// SPDX-License-Identifier: Apache-2.0
#include "coordinator/rest/downloads.h"

#include <cstdlib>
#include <filesystem>

#include <gtest/gtest.h>

#include "common/base/check.h"
#include "common/base/files.h"

namespace meshwright {
namespace {

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
