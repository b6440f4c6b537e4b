// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "pipeline/cameras/colmap_database.h"
#include "pipeline/cameras/nearest_descriptors.h"

#include "common/base/thread_pool.h"

namespace meshwright {

// Features of two photographs that are each other's nearest by the angle between their descriptors, near enough, and
// nearer than the second by far (Lowe 2004), in the order of the first's. The limits are COLMAP's: 0.7, 0.8. COLMAP's
// own matchers on a CPU search trees that are shuffled anew in every run, so two runs differ; these compare each
// feature with each, exactly.
std::vector<FeatureMatch> MatchFeatures(const PackedDescriptors& a, const PackedDescriptors& b);

// What goes on: pairs done of all; false stops it with Cancelled.
using MatchingProgress = std::function<bool(int64_t done, int64_t total)>;

// Matches the photographs' features pair by pair into the database, some dozens of photographs in memory at a time.
// Pairs that have matches there already are left as they are.
absl::Status MatchPairs(ColmapDatabase& database, const std::vector<ImagePair>& pairs, ThreadPool& pool,
                        const MatchingProgress& progress);

// Pairs of each photograph with the `per_photograph` that share most of its largest features (Wu, Towards linear-time
// incremental structure from motion, 2013, section 3), ascending. Takes 33 kB for each photograph.
absl::StatusOr<std::vector<ImagePair>> FindSimilarPairs(ColmapDatabase& database, int64_t images, size_t per_photograph,
                                                        ThreadPool& pool, const MatchingProgress& progress);

}  // namespace meshwright
