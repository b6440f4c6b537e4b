// SPDX-License-Identifier: Apache-2.0
#include "coordinator/nodeodm/zip_archive.h"

#include <cstdlib>
#include <filesystem>

#include <absl/strings/str_cat.h>
#include <gtest/gtest.h>

#include "common/base/check.h"
#include "common/base/files.h"

namespace meshwright {
namespace {

class ZipArchiveTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = testing::TempDir() + "zip_XXXXXX";
    MW_CHECK(mkdtemp(folder_.data()) != nullptr);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  ZipEntry Entry(const std::string& name, const std::string& content) {
    const std::string path = absl::StrCat(folder_, "/", ++files_);
    MW_CHECK(WriteFileAtomically(path, content).ok());
    const auto entry = MakeZipEntry(name, path);
    MW_CHECK(entry.ok());
    return *entry;
  }
  static std::string ReadAll(const ZipArchive& archive, size_t piece) {
    std::string all;
    while (static_cast<int64_t>(all.size()) < archive.size_bytes()) {
      all += *archive.Read(static_cast<int64_t>(all.size()), piece);
    }
    return all;
  }

  std::string folder_;
  int files_ = 0;
};

TEST_F(ZipArchiveTest, AnyRangeHasTheBytesOfTheWhole) {
  const auto archive =
      *ZipArchive::Open({Entry("a/one.txt", "one"), Entry("empty", ""), Entry("b/na\xC3\xAFve", "22")});
  const std::string all = ReadAll(*archive, 1 << 20);
  EXPECT_EQ(static_cast<int64_t>(all.size()), archive->size_bytes());
  EXPECT_EQ(ReadAll(*archive, 1), all);
  for (size_t offset = 0; offset < all.size(); ++offset) {
    for (const size_t most : {size_t{1}, size_t{5}, size_t{70}}) {
      EXPECT_EQ(*archive->Read(static_cast<int64_t>(offset), most), all.substr(offset, most));
    }
  }
  // The same entries, the same bytes.
  EXPECT_EQ(
      ReadAll(*(*ZipArchive::Open({Entry("a/one.txt", "one"), Entry("empty", ""), Entry("b/na\xC3\xAFve", "22")})), 9),
      all);
}

TEST_F(ZipArchiveTest, OthersCanReadIt) {
  std::string large(3 << 20, 'x');
  large[12345] = '\0';
  const auto archive = *ZipArchive::Open({Entry("a/one.txt", "one"), Entry("empty", ""), Entry("large", large)});
  const std::string path = folder_ + "/all.zip";
  ASSERT_TRUE(WriteFileAtomically(path, ReadAll(*archive, 100'000)).ok());
  const std::string script =
      "import sys, zipfile; z = zipfile.ZipFile(sys.argv[1]); assert z.testzip() is None; "
      "assert z.namelist() == ['a/one.txt', 'empty', 'large']; assert z.read('a/one.txt') == b'one'; "
      "assert len(z.read('large')) == 3 << 20";
  EXPECT_EQ(std::system(absl::StrCat("python3 -c \"", script, "\" ", path).c_str()), 0);
}

TEST_F(ZipArchiveTest, FilesBeyond4GiBAreZip64) {
  const std::string sparse = folder_ + "/sparse";
  ASSERT_TRUE(WriteFileAtomically(sparse, std::string()).ok());
  const int64_t size = (int64_t{1} << 32) + 17;
  std::filesystem::resize_file(sparse, static_cast<uintmax_t>(size));
  // Its CRC does not matter here, and reading 4 GiB would take seconds.
  const auto archive = *ZipArchive::Open({{"sparse", sparse, size, 0}, Entry("behind", "content")});
  const std::string tail = *archive->Read(size, 1000);
  const std::string path = folder_ + "/tail";
  ASSERT_TRUE(WriteFileAtomically(path, tail).ok());
  // Python reads the directory at the end, of a file of the same length that is otherwise empty.
  const std::string script =
      "import os, sys, zipfile; n = int(sys.argv[2]); t = open(sys.argv[1], 'rb').read(); p = sys.argv[1] + '.zip'; "
      "f = open(p, 'wb'); f.truncate(n - len(t)); f.seek(n - len(t)); f.write(t); f.close(); z = zipfile.ZipFile(p); "
      "assert [(i.filename, i.file_size) for i in z.infolist()] == [('sparse', (1 << 32) + 17), ('behind', 7)]; "
      "assert z.read('behind') == b'content'";
  EXPECT_EQ(std::system(absl::StrCat("python3 -c \"", script, "\" ", path, " ", archive->size_bytes()).c_str()), 0);
}

TEST_F(ZipArchiveTest, AFileThatChangedIsSeen) {
  ZipEntry entry = Entry("a", "content");
  ++entry.size_bytes;
  EXPECT_FALSE(ZipArchive::Open({entry}).ok());
  entry.path += "-gone";
  EXPECT_TRUE(absl::IsNotFound(ZipArchive::Open({entry}).status()));
}

}  // namespace
}  // namespace meshwright
