#pragma once

#include <cstdint>
#include <memory>
#include <string>
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
  absl::StatusOr<PairCounts> CountPairs();
  // Forgets which pairs were verified, and gives the pairs that are worth it as lines of two names, by their numbers.
  absl::StatusOr<std::string> StartVerification();

 private:
  explicit ColmapDatabase(std::string path) : path_(std::move(path)) {}
  absl::Status Execute(const std::string& sql);
  absl::StatusOr<std::vector<int64_t>> Integers(const std::string& sql);
  absl::Status PutCamera(int64_t id, const CameraGroup& group);
  absl::Status PutImage(int64_t id, int64_t camera, const std::string& name);
  absl::Status Fill(const std::vector<CameraGroup>& groups, const std::vector<std::string>& names);
  absl::Status Error() const;

  const std::string path_;
  sqlite3* connection_ = nullptr;
};

}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
