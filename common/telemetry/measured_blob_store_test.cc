// SPDX-License-Identifier: Apache-2.0
#include "common/telemetry/measured_blob_store.h"

#include <filesystem>
#include <memory>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/blob/filesystem_blob_store.h"

namespace meshwright {
namespace {

using testing::HasSubstr;
using testing::Not;

TEST(MeasuredBlobStoreTest, PassesThroughAndCounts) {
  const std::string folder = testing::TempDir() + "measured_blobs";
  std::filesystem::remove_all(folder);
  const auto blobs = FilesystemBlobStore::Open(folder);
  ASSERT_TRUE(blobs.ok()) << blobs.status();
  Metrics metrics("worker");
  MeasuredBlobStore measured(**blobs, metrics);

  const auto digest = measured.Put("twelve bytes");
  ASSERT_TRUE(digest.ok());
  EXPECT_EQ(measured.Get(*digest).value(), "twelve bytes");
  EXPECT_EQ(measured.Get(*digest).value(), "twelve bytes");
  EXPECT_TRUE(measured.Has(*digest).value());
  EXPECT_THAT(metrics.Text(), Not(HasSubstr("meshwright_blob_errors_total")));
  EXPECT_TRUE(measured.Delete(*digest).ok());
  EXPECT_TRUE(absl::IsNotFound(measured.Get(*digest).status()));

  const std::string text = metrics.Text();
  EXPECT_THAT(text, HasSubstr("meshwright_blob_written_bytes_total 12\n"));
  EXPECT_THAT(text, HasSubstr("meshwright_blob_read_bytes_total 24\n"));
  EXPECT_THAT(text, HasSubstr("meshwright_blob_seconds_count{operation=\"get\"} 3\n"));
  EXPECT_THAT(text, HasSubstr("meshwright_blob_seconds_count{operation=\"put\"} 1\n"));
  EXPECT_THAT(text, HasSubstr("meshwright_blob_errors_total{code=\"not_found\",operation=\"get\"} 1\n"));
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace meshwright
