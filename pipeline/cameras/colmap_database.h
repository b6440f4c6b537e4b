// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "pipeline/cameras/camera_groups.h"

struct sqlite3;

namespace meshwright {

struct PairCounts {
  int64_t matched = 0;   // pairs with enough alike features to try
  int64_t verified = 0;  // pairs whose matches fit one motion of the camera
};

// Numbers of images as the database has them, the smaller first.
using ImagePair = std::pair<int64_t, int64_t>;

// Features of both images, by their numbers from 0.
struct FeatureMatch {
  uint32_t first = 0;
  uint32_t second = 0;

  friend bool operator==(const FeatureMatch&, const FeatureMatch&) = default;
};
static_assert(sizeof(FeatureMatch) == 8, "as the database has them");

struct PairMatches {
  ImagePair pair;
  std::vector<FeatureMatch> matches;
};

// The database (SQLite) that COLMAP's programs share, as COLMAP 3.6 to 3.11 make it. Cameras and photographs are put in
// by us and not by the feature extractor: so cameras are shared as we group them, and numbers do not depend on which of
// the extractor's threads was first. Errors name the file.
class ColmapDatabase {
 public:
  // FailedPrecondition: made by a COLMAP whose tables are others.
  static absl::StatusOr<std::unique_ptr<ColmapDatabase>> Open(const std::string& path);
  ~ColmapDatabase();
  ColmapDatabase(const ColmapDatabase&) = delete;
  ColmapDatabase& operator=(const ColmapDatabase&) = delete;

  // Image i + 1 is photograph i, under `names[i]`. Does nothing but rename when they are there already.
  absl::Status PutPhotographs(const std::vector<CameraGroup>& groups, const std::vector<std::string>& names);
  // Features of each image, in the order of their numbers.
  absl::StatusOr<std::vector<int64_t>> CountFeatures();
  // SIFT descriptors of an image, kDescriptorBytes each, and how large each feature is, px. Empty: it has none.
  absl::StatusOr<std::string> Descriptors(int64_t image);
  absl::StatusOr<std::vector<float>> FeatureScales(int64_t image);
  // Pairs that have been matched, those without a match too.
  absl::StatusOr<std::set<ImagePair>> MatchedPairs();
  // All of them or none.
  absl::Status PutMatches(const std::vector<PairMatches>& pairs);
  absl::StatusOr<PairCounts> CountPairs();
  // Forgets which pairs were verified, and gives the pairs that are worth it as lines of two names, by their numbers.
  absl::StatusOr<std::string> StartVerification();

 private:
  explicit ColmapDatabase(std::string path) : path_(std::move(path)) {}
  absl::Status Execute(const std::string& sql);
  absl::StatusOr<std::vector<int64_t>> Integers(const std::string& sql);
  absl::Status PutCamera(int64_t id, const CameraGroup& group);
  absl::Status PutImage(int64_t id, int64_t camera, const std::string& name);
  absl::Status PutMatchesOfPair(const PairMatches& pair);
  // The table's row for an image: how many, numbers of each, and their bytes.
  struct Array {
    int64_t rows = 0;
    int64_t columns = 0;
    std::string bytes;
  };
  absl::StatusOr<Array> ReadArray(const std::string& table, int64_t image, size_t value_bytes);
  absl::Status InTransaction(const std::function<absl::Status()>& change);
  absl::Status Fill(const std::vector<CameraGroup>& groups, const std::vector<std::string>& names);
  absl::Status Error() const;

  const std::string path_;
  sqlite3* connection_ = nullptr;
};

}  // namespace meshwright
