// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <random>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/base/digest.h"
#include "common/base/files.h"
#include "common/blob/blob_store.h"
#include "common/blob/staged_blob.h"

namespace meshwright {

// What every BlobStore must do. A backend's test makes its harness and instantiates the suite:
//   INSTANTIATE_TEST_SUITE_P(Filesystem, BlobStoreConformanceTest, testing::Values(&MakeFilesystemHarness));
class BlobStoreHarness {
 public:
  virtual ~BlobStoreHarness() = default;
  // The store under test; empty at first.
  virtual BlobStore& store() = 0;
  // A second store over the same bytes, as another process would open it.
  virtual std::unique_ptr<BlobStore> OpenAgain() = 0;
  // Replaces what is stored under a digest, behind the store's back.
  virtual void Overwrite(const std::string& digest, const std::string& bytes) = 0;
};

// Null, with the reason in `skip`, where the backend cannot be had.
using MakeBlobStoreHarness = std::unique_ptr<BlobStoreHarness> (*)(std::string* skip);

class BlobStoreConformanceTest : public testing::TestWithParam<MakeBlobStoreHarness> {
 protected:
  void SetUp() override {
    std::string skip;
    harness_ = GetParam()(&skip);
    if (harness_ == nullptr) GTEST_SKIP() << skip;
  }
  BlobStore& store() { return harness_->store(); }

  static std::string RandomBytes(uint32_t seed, size_t size) {
    std::mt19937 random(seed);
    std::string bytes(size, '\0');
    for (char& c : bytes) c = static_cast<char>(random());
    return bytes;
  }

  std::unique_ptr<BlobStoreHarness> harness_;
};

TEST_P(BlobStoreConformanceTest, WhatIsPutIsGot) {
  for (const size_t size : {0, 1, 1000, 3'000'000}) {
    const std::string bytes = RandomBytes(1, size);
    const auto digest = store().Put(bytes);
    ASSERT_TRUE(digest.ok()) << digest.status();
    EXPECT_EQ(*digest, Sha256Hex(bytes));
    const auto got = store().Get(*digest);
    ASSERT_TRUE(got.ok()) << got.status();
    EXPECT_TRUE(*got == bytes);
    EXPECT_TRUE(*store().Has(*digest));
  }
}

TEST_P(BlobStoreConformanceTest, WhatWasNotPutIsNotFound) {
  const std::string digest = Sha256Hex("never put");
  EXPECT_EQ(store().Get(digest).status().code(), absl::StatusCode::kNotFound);
  const auto has = store().Has(digest);
  ASSERT_TRUE(has.ok()) << has.status();
  EXPECT_FALSE(*has);
}

TEST_P(BlobStoreConformanceTest, PuttingTwiceIsHarmless) {
  const std::string bytes = RandomBytes(2, 5000);
  const auto first = store().Put(bytes);
  const auto second = store().Put(bytes);
  ASSERT_TRUE(first.ok() && second.ok());
  EXPECT_EQ(*first, *second);
  EXPECT_TRUE(*store().Get(*first) == bytes);
}

TEST_P(BlobStoreConformanceTest, FilesAreBlobsToo) {
  const std::string path = testing::TempDir() + "file_of_a_blob";
  const std::string bytes = RandomBytes(9, 3'000'000);
  ASSERT_TRUE(WriteFileAtomically(path, bytes).ok());
  const auto digest = store().PutFile(path);
  ASSERT_TRUE(digest.ok()) << digest.status();
  EXPECT_EQ(*digest, Sha256Hex(bytes));
  EXPECT_TRUE(*store().Get(*digest) == bytes);
  std::remove(path.c_str());
  EXPECT_EQ(store().PutFile(path).status().code(), absl::StatusCode::kNotFound);
  ASSERT_TRUE(store().GetFile(*digest, path).ok());
  EXPECT_TRUE(*ReadFile(path) == bytes);
  std::remove(path.c_str());
  harness_->Overwrite(*digest, bytes.substr(1));
  EXPECT_EQ(store().GetFile(*digest, path).code(), absl::StatusCode::kDataLoss);
  EXPECT_EQ(ReadFile(path).status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(store().GetFile(Sha256Hex(std::string("nothing")), path).code(), absl::StatusCode::kNotFound);
}

TEST_P(BlobStoreConformanceTest, FilesAreAdopted) {
  for (const size_t size : {0, 3'000'000}) {
    const std::string bytes = RandomBytes(11, size);
    const std::string staging = store().staging_folder();
    const auto path = StagedBlob::NewPath(staging.empty() ? testing::TempDir() : staging);
    ASSERT_TRUE(path.ok()) << path.status();
    const auto staged = StagedBlob::Open(*path);
    ASSERT_TRUE(staged.ok()) << staged.status();
    ASSERT_TRUE(
        (*staged)->Append(absl::MakeConstSpan(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size())).ok());
    ASSERT_TRUE((*staged)->Sync().ok());
    const absl::Status adopted = (*staged)->Adopt(store());
    ASSERT_TRUE(adopted.ok()) << adopted;
    EXPECT_TRUE(*store().Get(Sha256Hex(bytes)) == bytes);
    EXPECT_EQ(ReadFile(*path).status().code(), absl::StatusCode::kNotFound);
  }
}

TEST_P(BlobStoreConformanceTest, DeletedBlobsAreGoneAndOthersStay) {
  const std::string gone = *store().Put("gone");
  const std::string kept = *store().Put("kept");
  EXPECT_TRUE(store().Delete(gone).ok());
  EXPECT_TRUE(store().Delete(gone).ok());
  EXPECT_EQ(store().Get(gone).status().code(), absl::StatusCode::kNotFound);
  EXPECT_FALSE(*store().Has(gone));
  EXPECT_EQ(*store().Get(kept), "kept");
  EXPECT_EQ(*store().Put("gone"), gone);
  EXPECT_EQ(*store().Get(gone), "gone");
}

TEST_P(BlobStoreConformanceTest, DamageIsDataLossThatNamesTheDigestUntilThePutThatMendsIt) {
  const std::string bytes = RandomBytes(3, 100);
  const std::string digest = *store().Put(bytes);
  std::string flipped = bytes;
  flipped[50] ^= 1;
  for (const std::string& damaged : {flipped, bytes.substr(0, 60), std::string()}) {
    harness_->Overwrite(digest, damaged);
    const absl::Status status = store().Get(digest).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss) << status;
    EXPECT_THAT(status.ToString(), testing::HasSubstr(digest));
  }
  ASSERT_TRUE(store().Put(bytes).ok());
  EXPECT_EQ(*store().Get(digest), bytes);
}

TEST_P(BlobStoreConformanceTest, OtherProcessesSeeTheBlobs) {
  const std::unique_ptr<BlobStore> other = harness_->OpenAgain();
  const std::string digest = *store().Put("seen by all");
  EXPECT_EQ(*other->Get(digest), "seen by all");
  ASSERT_TRUE(other->Delete(digest).ok());
  EXPECT_FALSE(*store().Has(digest));
}

TEST_P(BlobStoreConformanceTest, OnlyDigestsNameBlobs) {
  const std::string digest = *store().Put("x");
  std::string upper = digest;
  for (char& c : upper) c = static_cast<char>(c >= 'a' && c <= 'f' ? c - 'a' + 'A' : c);
  ASSERT_NE(upper, digest);
  for (const std::string& bad : {std::string(), std::string("../../etc/passwd"), digest.substr(1), digest + "0", upper,
                                 std::string(64, '/'), std::string(64, '\0')}) {
    EXPECT_EQ(store().Get(bad).status().code(), absl::StatusCode::kInvalidArgument) << bad;
    EXPECT_EQ(store().Has(bad).status().code(), absl::StatusCode::kInvalidArgument) << bad;
    EXPECT_EQ(store().Delete(bad).code(), absl::StatusCode::kInvalidArgument) << bad;
  }
}

// Threads put, get and put again an overlapping set of blobs: whatever is there is whole.
TEST_P(BlobStoreConformanceTest, ThreadsAndProcessesDoNotDisturbEachOther) {
  constexpr int kThreads = 6;
  constexpr uint32_t kBlobs = 12;
  std::vector<std::string> blobs;
  for (uint32_t i = 0; i < kBlobs; ++i) blobs.push_back(RandomBytes(100 + i, 20'000 + 1000 * i));
  const std::unique_ptr<BlobStore> other = harness_->OpenAgain();
  std::atomic<int> faults{0};
  std::vector<std::thread> threads;
  threads.reserve(kThreads + 1);
  for (int t = 0; t < kThreads; ++t) {
    threads.emplace_back([&, t] {
      BlobStore& mine = t % 2 == 0 ? store() : *other;
      for (uint32_t i = 0; i < 2 * kBlobs; ++i) {
        const std::string& bytes = blobs[(i * 5 + static_cast<uint32_t>(t)) % kBlobs];
        const auto digest = mine.Put(bytes);
        if (!digest.ok()) {
          ++faults;
          continue;
        }
        const auto got = mine.Get(*digest);
        if (!got.ok() || *got != bytes) ++faults;
      }
    });
  }
  // Reads what others may be writing just now.
  threads.emplace_back([&] {
    for (int round = 0; round < 20; ++round) {
      for (const std::string& bytes : blobs) {
        const auto got = store().Get(Sha256Hex(bytes));
        if (got.ok() ? *got != bytes : got.status().code() != absl::StatusCode::kNotFound) ++faults;
      }
    }
  });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(faults.load(), 0);
}

}  // namespace meshwright
