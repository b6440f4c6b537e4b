// SPDX-License-Identifier: Apache-2.0
#include "common/base/files.h"

#include <chrono>
#include <filesystem>
#include <string>

#include <gtest/gtest.h>
#include <sys/stat.h>

#include "common/base/clock.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

class FilesTest : public testing::Test {
 protected:
  FilesTest() : folder_(fs::path(testing::TempDir()) / "meshwright_files_test") {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~FilesTest() override { fs::remove_all(folder_); }
  fs::path folder_;
};

TEST_F(FilesTest, WhatIsWrittenIsRead) {
  const std::string path = (folder_ / "a").string();
  ASSERT_TRUE(WriteFileAtomically(path, std::string("hello\0world", 11)).ok());
  EXPECT_EQ(*ReadFile(path), std::string("hello\0world", 11));
}

TEST_F(FilesTest, MissingFileIsNotFoundAndNamed) {
  const auto result = ReadFile((folder_ / "nothing-here").string());
  EXPECT_EQ(result.status().code(), absl::StatusCode::kNotFound);
  EXPECT_NE(result.status().ToString().find("nothing-here"), std::string::npos);
}

TEST_F(FilesTest, NothingIsLeftWithoutCommit) {
  {
    auto file = AtomicFile::Create((folder_ / "b").string());
    ASSERT_TRUE(file.ok());
    ASSERT_TRUE(file->Append(std::string(3'000'000, 'x')).ok());
  }
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(FilesTest, HeaderCanBeWrittenLast) {
  const std::string path = (folder_ / "c").string();
  auto file = AtomicFile::Create(path);
  ASSERT_TRUE(file.ok());
  ASSERT_TRUE(file->Append(std::string("00body")).ok());
  ASSERT_TRUE(file->WriteAt(0, "42").ok());
  ASSERT_TRUE(file->Append(std::string("!")).ok());
  ASSERT_TRUE(file->Commit().ok());
  EXPECT_EQ(*ReadFile(path), "42body!");
}

TEST_F(FilesTest, FolderThatDoesNotExistIsAnErrorThatNamesTheFile) {
  const absl::Status status = WriteFileAtomically((folder_ / "no" / "file").string(), std::string("x"));
  EXPECT_FALSE(status.ok());
  EXPECT_NE(status.ToString().find("no/file"), std::string::npos);
}

TEST_F(FilesTest, ALinkStaysAndItsTargetIsReplaced) {
  const std::string target = (folder_ / "target").string();
  const std::string link = (folder_ / "link").string();
  ASSERT_TRUE(WriteFileAtomically(target, std::string("before")).ok());
  fs::create_symlink("target", link);
  ASSERT_TRUE(WriteFileAtomically(link, std::string("after")).ok());
  EXPECT_TRUE(fs::is_symlink(link));
  EXPECT_EQ(*ReadFile(target), "after");
  const std::string to_nothing = (folder_ / "to_nothing").string();
  fs::create_symlink("made", to_nothing);
  ASSERT_TRUE(WriteFileAtomically(to_nothing, std::string("new")).ok());
  EXPECT_EQ(*ReadFile((folder_ / "made").string()), "new");
}

TEST_F(FilesTest, WhatIsNoFileIsNotReplaced) {
  const std::string pipe = (folder_ / "pipe").string();
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  for (const std::string& path : {pipe, folder_.string(), std::string("/dev/null")}) {
    EXPECT_EQ(WriteFileAtomically(path, std::string("x")).code(), absl::StatusCode::kInvalidArgument) << path;
  }
  EXPECT_TRUE(fs::is_fifo(pipe));
}

TEST_F(FilesTest, OnlyStalePartialFilesAreRemoved) {
  fs::create_directories(folder_ / "ab");
  const fs::path stale = folder_ / "ab" / "blob.partial-12-0";
  const fs::path fresh = folder_ / "ab" / "blob.partial-13-0";
  const fs::path whole = folder_ / "ab" / "blob";
  for (const fs::path& path : {stale, fresh, whole})
    ASSERT_TRUE(WriteFileAtomically(path.string(), std::string("x")).ok());
  const auto two_days_ago = fs::file_time_type::clock::now() - std::chrono::hours(48);
  fs::last_write_time(stale, two_days_ago);
  fs::last_write_time(whole, two_days_ago);
  RemoveStalePartialFiles(folder_.string(), SystemClock().Now() - absl::Hours(24));
  EXPECT_FALSE(fs::exists(stale));
  EXPECT_TRUE(fs::exists(fresh));
  EXPECT_TRUE(fs::exists(whole));
}

TEST_F(FilesTest, PartialFilesOfOnePathAreRemovedAlone) {
  const std::string path = (folder_ / "mesh.ply").string();
  const std::string other = (folder_ / "mesh.ply2").string();
  const std::string left = PartialPath(path);
  const std::string left_by_other = PartialPath(other);
  EXPECT_NE(left, PartialPath(path)) << "a name of its own each time";
  for (const std::string& file : {path, other, left, left_by_other}) {
    ASSERT_TRUE(WriteFileAtomically(file, std::string("x")).ok());
  }
  RemovePartialFiles(path);
  EXPECT_FALSE(fs::exists(left));
  EXPECT_TRUE(fs::exists(path));
  EXPECT_TRUE(fs::exists(other));
  EXPECT_TRUE(fs::exists(left_by_other));
}

}  // namespace
}  // namespace meshwright
