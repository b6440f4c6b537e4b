// SPDX-License-Identifier: Apache-2.0
#include "common/blob/staged_blob.h"

#include <filesystem>

#include <gtest/gtest.h>
#include <sys/stat.h>

#include "common/base/files.h"
#include "common/blob/filesystem_blob_store.h"

namespace meshwright {
namespace {

absl::Span<const uint8_t> Bytes(const std::string& text) {
  return absl::MakeConstSpan(reinterpret_cast<const uint8_t*>(text.data()), text.size());
}

class StagedBlobTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = testing::TempDir() + "staged_XXXXXX";
    ASSERT_NE(mkdtemp(pattern.data()), nullptr);
    root_ = pattern;
    store_ = *FilesystemBlobStore::Open(root_ + "/blobs");
  }
  void TearDown() override { std::filesystem::remove_all(root_); }

  std::string root_;
  std::unique_ptr<FilesystemBlobStore> store_;
};

TEST_F(StagedBlobTest, TheFileThatWasWrittenIsTheBlob) {
  const std::string path = *StagedBlob::NewPath(store_->staging_folder());
  const auto staged = *StagedBlob::Open(path);
  ASSERT_TRUE(staged->Append(Bytes("wall ")).ok());
  ASSERT_TRUE(staged->Append(Bytes("and roof")).ok());
  EXPECT_EQ(staged->HexDigest(), Sha256Hex(std::string("wall and roof")));
  ASSERT_TRUE(staged->Sync().ok());
  struct stat before {};
  ASSERT_EQ(::stat(path.c_str(), &before), 0);
  ASSERT_TRUE(staged->Adopt(*store_).ok());
  struct stat after {};
  ASSERT_EQ(::stat(store_->PathOf(staged->HexDigest()).c_str(), &after), 0);
  EXPECT_EQ(after.st_ino, before.st_ino);  // moved: no byte was written twice
  EXPECT_FALSE(std::filesystem::exists(path));
  EXPECT_EQ(*store_->Get(staged->HexDigest()), "wall and roof");
}

TEST_F(StagedBlobTest, GoesOnBehindWhatIsKept) {
  const std::string path = *StagedBlob::NewPath(root_ + "/staging");
  Sha256Stream kept;
  {
    const auto staged = *StagedBlob::Open(path);
    ASSERT_TRUE(staged->Append(Bytes("wall ")).ok());
    kept = staged->digest();
    ASSERT_TRUE(staged->Append(Bytes("that nobody vouched for")).ok());
  }
  EXPECT_EQ(Sha256Stream(kept).HexDigest(), StagedBlob::DigestOf(path, 5)->HexDigest());
  const auto staged = *StagedBlob::Open(path, 5, kept);
  ASSERT_TRUE(staged->Append(Bytes("and roof")).ok());
  EXPECT_EQ(staged->HexDigest(), Sha256Hex(std::string("wall and roof")));
  EXPECT_EQ(*staged->Read(0, 100), "wall and roof");
  EXPECT_TRUE(absl::IsDataLoss(StagedBlob::Open(path, 14).status()));
  EXPECT_TRUE(absl::IsDataLoss(StagedBlob::DigestOf(path, 14).status()));
}

}  // namespace
}  // namespace meshwright
