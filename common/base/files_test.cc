#include "common/base/files.h"

#include <filesystem>
#include <string>

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace meshwright
