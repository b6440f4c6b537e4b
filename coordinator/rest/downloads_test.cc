// SPDX-License-Identifier: Apache-2.0
#include "coordinator/rest/downloads.h"

#include <cstdlib>
#include <filesystem>
#include <future>
#include <thread>

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

TEST(DerivedFilesTest, FoldersAreMadeOnceAndNotLeft) {
  std::string folder = testing::TempDir() + "derived_XXXXXX";
  MW_CHECK(mkdtemp(folder.data()) != nullptr);
  const auto files = *DerivedFiles::Open(folder + "/derived");
  MW_CHECK(WriteFileAtomically(folder + "/secret", "of somebody else").ok());
  int made = 0;
  const auto get = [&](const std::string& key, const std::string& name) {
    return files->GetFrom(key, name, [&](const std::string& path) {
      ++made;
      std::filesystem::create_directories(path + "/inner");
      return WriteFileAtomically(path + "/inner/a", "of " + key);
    });
  };
  EXPECT_EQ((*get("0", "inner/a"))->size_bytes(), 4);
  EXPECT_TRUE(absl::IsNotFound(get("0", "inner").status())) << "a folder is no file";
  EXPECT_TRUE(absl::IsNotFound(get("0", "inner/b").status()));
  for (const char* outside : {"../../secret", "inner/../../../secret", "/etc/passwd", "", "inner//a"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(get("0", outside).status())) << outside;
  }
  EXPECT_EQ(made, 1);
  for (int key = 1; key < 20; ++key) EXPECT_TRUE(get(std::to_string(key), "inner/a").ok());
  EXPECT_LE(std::distance(std::filesystem::directory_iterator(folder + "/derived"), {}), 8);
  std::filesystem::remove_all(folder);
}

// What is there is had at once while another one is being made, which may take minutes.
TEST(DerivedFilesTest, WhatIsThereIsNotWaitedFor) {
  std::string folder = testing::TempDir() + "derived_XXXXXX";
  MW_CHECK(mkdtemp(folder.data()) != nullptr);
  const auto files = *DerivedFiles::Open(folder + "/derived");
  const auto write = [](const std::string& path) { return WriteFileAtomically(path, "here"); };
  MW_CHECK(files->Get("here", write).ok());
  std::promise<void> begun;
  std::promise<void> may_end;
  std::thread slow([&] {
    EXPECT_TRUE(files
                    ->Get("slow",
                          [&](const std::string& path) {
                            begun.set_value();
                            may_end.get_future().wait();
                            return write(path);
                          })
                    .ok());
  });
  begun.get_future().wait();
  EXPECT_TRUE(files->Get("here", write).ok());  // or this test never ends
  may_end.set_value();
  slow.join();
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace meshwright
