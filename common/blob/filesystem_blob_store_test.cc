// SPDX-License-Identifier: Apache-2.0
#include "common/blob/filesystem_blob_store.h"

#include <atomic>
#include <filesystem>
#include <fstream>

#include <sys/mount.h>
#include <unistd.h>

#include "common/base/files.h"
#include "common/blob/blob_store_conformance.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

std::string NewFolder() {
  static std::atomic<int> counter{0};
  const fs::path folder = fs::path(testing::TempDir()) / ("meshwright_blob_test_" + std::to_string(::getpid()) + "_" +
                                                          std::to_string(counter.fetch_add(1)));
  fs::remove_all(folder);
  fs::create_directories(folder);
  return folder.string();
}

class FilesystemHarness : public BlobStoreHarness {
 public:
  FilesystemHarness() : folder_(NewFolder()), store_(*FilesystemBlobStore::Open(folder_ + "/made/here")) {}
  ~FilesystemHarness() override { fs::remove_all(folder_); }
  BlobStore& store() override { return *store_; }
  std::unique_ptr<BlobStore> OpenAgain() override { return *FilesystemBlobStore::Open(folder_ + "/made/here"); }
  void Overwrite(const std::string& digest, const std::string& bytes) override {
    std::ofstream(store_->PathOf(digest), std::ios::binary | std::ios::trunc) << bytes;
  }

 private:
  std::string folder_;
  std::unique_ptr<FilesystemBlobStore> store_;
};

std::unique_ptr<BlobStoreHarness> MakeFilesystemHarness(std::string*) { return std::make_unique<FilesystemHarness>(); }

INSTANTIATE_TEST_SUITE_P(Filesystem, BlobStoreConformanceTest, testing::Values(&MakeFilesystemHarness));

class FilesystemBlobStoreTest : public testing::Test {
 protected:
  FilesystemBlobStoreTest() : folder_(NewFolder()) {}
  ~FilesystemBlobStoreTest() override { fs::remove_all(folder_); }
  std::string folder_;
};

TEST_F(FilesystemBlobStoreTest, BlobsLieInFoldersByTheFirstTwoDigits) {
  const auto store = *FilesystemBlobStore::Open(folder_);
  const std::string digest = *store->Put("hello");
  EXPECT_EQ(*ReadFile(folder_ + "/" + digest.substr(0, 2) + "/" + digest), "hello");
}

TEST_F(FilesystemBlobStoreTest, NothingButBlobsIsLeft) {
  const auto store = *FilesystemBlobStore::Open(folder_);
  const std::string digest = *store->Put("hello");
  ASSERT_TRUE(store->Put("hello").ok());
  for (const auto& entry : fs::recursive_directory_iterator(folder_)) {
    EXPECT_TRUE(!entry.is_regular_file() || entry.path().filename() == digest) << entry.path();
  }
}

TEST_F(FilesystemBlobStoreTest, ErrorsNamePathAndBothDigests) {
  const auto store = *FilesystemBlobStore::Open(folder_);
  const std::string digest = *store->Put("hello");
  std::ofstream(store->PathOf(digest), std::ios::trunc) << "hallo";
  const std::string message = store->Get(digest).status().ToString();
  EXPECT_THAT(message, HasSubstr(store->PathOf(digest)));
  EXPECT_THAT(message, HasSubstr("digest " + Sha256Hex("hallo")));
  EXPECT_THAT(message, HasSubstr("expected " + digest));
  EXPECT_THAT(store->Get(Sha256Hex("no")).status().ToString(), HasSubstr(store->PathOf(Sha256Hex("no"))));
}

TEST_F(FilesystemBlobStoreTest, FolderThatCannotBeMadeIsAnErrorThatNamesIt) {
  std::ofstream(folder_ + "/file") << "in the way";
  const auto store = FilesystemBlobStore::Open(folder_ + "/file/store");
  EXPECT_FALSE(store.ok());
  EXPECT_THAT(store.status().ToString(), HasSubstr(folder_ + "/file/store"));
}

TEST_F(FilesystemBlobStoreTest, FullDiskIsResourceExhaustedAndLeavesNothing) {
  const std::string small = folder_ + "/small";
  fs::create_directory(small);
  if (::mount("tmpfs", small.c_str(), "tmpfs", 0, "size=256k") != 0) GTEST_SKIP() << "may not mount a small disk here";
  {
    const auto store = *FilesystemBlobStore::Open(small);
    const std::string kept = *store->Put("kept");
    const std::string large(1 << 20, 'x');
    const absl::Status status = store->Put(large).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted) << status;
    EXPECT_THAT(status.ToString(), HasSubstr(store->PathOf(Sha256Hex(large))));
    EXPECT_FALSE(*store->Has(Sha256Hex(large)));
    EXPECT_TRUE(store->Put(std::string(1 << 17, 'y')).ok()) << "the space came back";
    EXPECT_EQ(*store->Get(kept), "kept");
  }
  ::umount(small.c_str());
}

}  // namespace
}  // namespace meshwright
