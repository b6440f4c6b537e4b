// SPDX-License-Identifier: Apache-2.0
#include "pipeline/cameras/feature_matching.h"

#include <cmath>
#include <random>
#include <string>

#include <gtest/gtest.h>
#include <sqlite3.h>

#include "pipeline/cameras/photographs_testing.h"

#include "common/base/check.h"

namespace meshwright {
namespace {

constexpr int64_t kImages = 12;
constexpr size_t kFeaturesOfImage = 40;
constexpr size_t kStep = 15;  // image i shows features i * kStep .. i * kStep + kFeaturesOfImage - 1 of the world

// A feature of the world, 512 long as COLMAP's are; the same number gives the same.
std::string WorldFeature(uint32_t number) {
  std::mt19937 random(number);
  double squared = 0;
  std::vector<double> values;
  for (size_t k = 0; k < kDescriptorBytes; ++k) {
    values.push_back(static_cast<double>(random() % 1000) * static_cast<double>(random() % 1000));
    squared += values.back() * values.back();
  }
  std::string bytes;
  for (const double value : values) {
    bytes += static_cast<char>(static_cast<uint8_t>(std::min(255.0, 512 * value / std::sqrt(squared))));
  }
  return bytes;
}

PackedDescriptors Pack(const std::string& bytes) {
  return PackedDescriptors({reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()});
}

class FeatureMatchingTest : public testing::Test {
 protected:
  FeatureMatchingTest() : path_(folder_ / "database.db") {
    sqlite3* connection = nullptr;
    MW_CHECK(sqlite3_open(path_.c_str(), &connection) == SQLITE_OK);
    Execute(connection,
            "CREATE TABLE keypoints(image_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB);"
            "CREATE TABLE descriptors(image_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB);"
            "CREATE TABLE matches(pair_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB);");
    for (int64_t image = 1; image <= kImages; ++image) {
      std::string hex;
      for (size_t i = 0; i < kFeaturesOfImage; ++i) {
        for (const char c : WorldFeature(static_cast<uint32_t>(static_cast<size_t>(image) * kStep + i))) {
          constexpr char kDigits[] = "0123456789abcdef";
          hex += kDigits[static_cast<uint8_t>(c) >> 4];
          hex += kDigits[static_cast<uint8_t>(c) & 15];
        }
      }
      const std::string id = std::to_string(image);
      const std::string rows = std::to_string(kFeaturesOfImage);
      Execute(connection, "INSERT INTO descriptors VALUES(" + id + ", " + rows + ", 128, x'" + hex + "');");
      Execute(connection, "INSERT INTO keypoints VALUES(" + id + ", " + rows + ", 6, zeroblob(24 * " + rows + "));");
    }
    sqlite3_close(connection);
    auto opened = ColmapDatabase::Open(path_);
    MW_CHECK(opened.ok());
    database_ = *std::move(opened);
  }

  static void Execute(sqlite3* connection, const std::string& sql) {
    MW_CHECK(sqlite3_exec(connection, sql.c_str(), nullptr, nullptr, nullptr) == SQLITE_OK);
  }

  TemporaryFolder folder_;
  const std::string path_;
  std::unique_ptr<ColmapDatabase> database_;
  ThreadPool pool_{3};
};

TEST_F(FeatureMatchingTest, TheSameFeaturesMatchAndNoOthers) {
  const auto one = database_->Descriptors(1);
  const auto two = database_->Descriptors(2);
  ASSERT_TRUE(one.ok() && two.ok());
  const std::vector<FeatureMatch> matches = MatchFeatures(Pack(*one), Pack(*two));
  ASSERT_EQ(matches.size(), kFeaturesOfImage - kStep);
  for (const FeatureMatch& match : matches) EXPECT_EQ(match.first, match.second + kStep);
}

TEST_F(FeatureMatchingTest, AFeatureThatIsThereTwiceMatchesNothing) {
  const std::string feature = WorldFeature(1);
  EXPECT_EQ(MatchFeatures(Pack(feature), Pack(feature)).size(), 1U);
  EXPECT_TRUE(MatchFeatures(Pack(feature), Pack(feature + feature)).empty());
  EXPECT_TRUE(MatchFeatures(Pack(feature + feature), Pack(feature)).empty());
}

TEST_F(FeatureMatchingTest, StoppedItGoesOnWithThePairsThatAreLeft) {
  const std::vector<ImagePair> pairs = {{1, 2}, {1, 3}, {1, 9}};
  EXPECT_TRUE(MatchPairs(*database_, {pairs[0]}, pool_, [](int64_t, int64_t) { return true; }).ok());
  EXPECT_TRUE(absl::IsCancelled(MatchPairs(*database_, pairs, pool_, [](int64_t, int64_t) { return false; })));
  std::vector<int64_t> told;
  const auto tell = [&](int64_t done, int64_t total) {
    EXPECT_EQ(total, 3);
    told.push_back(done);
    return true;
  };
  EXPECT_TRUE(MatchPairs(*database_, pairs, pool_, tell).ok());
  EXPECT_EQ(told, std::vector<int64_t>({1, 3}));
  const auto matched = database_->MatchedPairs();
  ASSERT_TRUE(matched.ok()) << matched.status();
  EXPECT_EQ(*matched, std::set<ImagePair>(pairs.begin(), pairs.end()));
}

TEST_F(FeatureMatchingTest, PhotographsThatShowTheSameAreSimilar) {
  const auto pairs = FindSimilarPairs(*database_, kImages, 2, pool_, [](int64_t, int64_t) { return true; });
  ASSERT_TRUE(pairs.ok()) << pairs.status();
  for (int64_t i = 1; i < kImages; ++i) {
    EXPECT_TRUE(std::ranges::find(*pairs, ImagePair(i, i + 1)) != pairs->end()) << i;
  }
  for (const auto& [first, second] : *pairs) EXPECT_LE(second - first, 2);
}

TEST_F(FeatureMatchingTest, DescriptorsOfAnotherKindAreRefused) {
  sqlite3* connection = nullptr;
  ASSERT_EQ(sqlite3_open(path_.c_str(), &connection), SQLITE_OK);
  Execute(connection,
          "UPDATE descriptors SET cols = 64, data = zeroblob(64 * 40) WHERE image_id = 1;"
          "UPDATE descriptors SET rows = 41 WHERE image_id = 2;");
  sqlite3_close(connection);
  EXPECT_TRUE(absl::IsInternal(database_->Descriptors(1).status()));
  EXPECT_TRUE(absl::IsInternal(database_->Descriptors(2).status()));
  EXPECT_TRUE(database_->Descriptors(99).value().empty());
}

}  // namespace
}  // namespace meshwright
