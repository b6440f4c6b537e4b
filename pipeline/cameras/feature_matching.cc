// SPDX-License-Identifier: Apache-2.0
#include "pipeline/cameras/feature_matching.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <set>
#include <span>
#include <string>
#include <utility>

#include "common/base/status_macros.h"

namespace meshwright {
namespace {

constexpr double kMaxAngle = 0.7;               // rad
constexpr double kMaxRatio = 0.8;               // of the nearest's angle to the second nearest's
constexpr double kSquaredLength = 512.0 * 512;  // of a descriptor, but for rounding
constexpr int64_t kPairsPerThread = 8;          // between two writes
constexpr size_t kLargestFeatures = 128;
constexpr size_t kFewestAlike = 3;

double Angle(int32_t product) { return std::acos(std::min(1.0, product / kSquaredLength)); }

bool IsClear(const NearestDescriptors& nearest, size_t i) {
  const double angle = Angle(nearest.best[i]);
  return angle <= kMaxAngle && angle < kMaxRatio * Angle(nearest.second[i]);
}

std::span<const uint8_t> Bytes(const std::string& text) {
  return {reinterpret_cast<const uint8_t*>(text.data()), text.size()};
}

absl::StatusOr<PackedDescriptors> ReadLargest(ColmapDatabase& database, int64_t image) {
  MW_ASSIGN_OR_RETURN(const std::string all, database.Descriptors(image));
  MW_ASSIGN_OR_RETURN(const std::vector<float> scales, database.FeatureScales(image));
  std::vector<size_t> order(std::min(scales.size(), all.size() / kDescriptorBytes));
  for (size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::ranges::stable_sort(order, [&](size_t i, size_t j) { return scales[i] > scales[j]; });
  if (order.size() > kLargestFeatures) order.resize(kLargestFeatures);
  std::string largest;
  for (const size_t i : order) largest += all.substr(i * kDescriptorBytes, kDescriptorBytes);
  return PackedDescriptors(Bytes(largest));
}

// The photographs most like one of them.
class MostAlike {
 public:
  explicit MostAlike(size_t most) : most_(most) {}
  void Add(int64_t image, size_t alike) {
    if (alike < kFewestAlike) return;
    list_.emplace_back(-static_cast<int64_t>(alike), image);
    if (list_.size() >= 4 * most_) Cut();
  }
  const std::vector<std::pair<int64_t, int64_t>>& Cut() {
    std::ranges::sort(list_);
    if (list_.size() > most_) list_.resize(most_);
    return list_;
  }

 private:
  size_t most_;
  std::vector<std::pair<int64_t, int64_t>> list_;  // (-alike features, image)
};

}  // namespace

std::vector<FeatureMatch> MatchFeatures(const PackedDescriptors& a, const PackedDescriptors& b) {
  NearestDescriptors of_a;
  NearestDescriptors of_b;
  FindNearest(a, b, &of_a, &of_b);
  std::vector<FeatureMatch> matches;
  for (size_t i = 0; i < a.count(); ++i) {
    if (of_a.index[i] < 0) continue;
    const auto j = static_cast<size_t>(of_a.index[i]);
    if (of_b.index[j] != static_cast<int32_t>(i) || !IsClear(of_a, i) || !IsClear(of_b, j)) continue;
    matches.push_back({static_cast<uint32_t>(i), static_cast<uint32_t>(j)});
  }
  return matches;
}

absl::Status MatchPairs(ColmapDatabase& database, const std::vector<ImagePair>& pairs, ThreadPool& pool,
                        const MatchingProgress& progress) {
  MW_ASSIGN_OR_RETURN(const std::set<ImagePair> matched, database.MatchedPairs());
  std::vector<ImagePair> left;
  std::ranges::set_difference(pairs, matched, std::back_inserter(left));
  const auto total = static_cast<int64_t>(pairs.size());
  const auto done = total - static_cast<int64_t>(left.size());
  const auto at_once = static_cast<size_t>(kPairsPerThread * pool.threads());
  std::map<int64_t, PackedDescriptors> packed;
  for (size_t begin = 0; begin < left.size(); begin += at_once) {
    if (!progress(done + static_cast<int64_t>(begin), total)) return absl::CancelledError("stopped");
    const size_t end = std::min(left.size(), begin + at_once);
    std::map<int64_t, PackedDescriptors> needed;
    for (size_t i = begin; i < end; ++i) {
      for (const int64_t image : {left[i].first, left[i].second}) {
        if (needed.contains(image)) continue;
        if (const auto it = packed.find(image); it != packed.end()) {
          needed.insert(packed.extract(it));
          continue;
        }
        MW_ASSIGN_OR_RETURN(const std::string bytes, database.Descriptors(image));
        needed.emplace(image, PackedDescriptors(Bytes(bytes)));
      }
    }
    packed = std::move(needed);
    std::vector<PairMatches> found(end - begin);
    pool.ParallelFor(static_cast<int64_t>(found.size()), 1, [&](int64_t from, int64_t to) {
      for (auto i = static_cast<size_t>(from); i < static_cast<size_t>(to); ++i) {
        const ImagePair& pair = left[begin + i];
        found[i] = {pair, MatchFeatures(packed.at(pair.first), packed.at(pair.second))};
      }
    });
    MW_RETURN_IF_ERROR(database.PutMatches(found));
  }
  progress(total, total);
  return absl::OkStatus();
}

absl::StatusOr<std::vector<ImagePair>> FindSimilarPairs(ColmapDatabase& database, int64_t images, size_t per_photograph,
                                                        ThreadPool& pool, const MatchingProgress& progress) {
  std::vector<PackedDescriptors> largest;
  for (int64_t image = 1; image <= images; ++image) {
    MW_ASSIGN_OR_RETURN(largest.emplace_back(), ReadLargest(database, image));
  }
  const auto count = largest.size();
  std::vector<MostAlike> alike(count, MostAlike(per_photograph));
  std::vector<size_t> shared(count);
  const auto total = static_cast<int64_t>(count * (count - 1) / 2);
  int64_t done = 0;
  for (size_t i = 0; i < count; ++i) {
    if (!progress(done, total)) return absl::CancelledError("stopped");
    pool.ParallelFor(static_cast<int64_t>(count - i - 1), 16, [&](int64_t begin, int64_t end) {
      for (size_t j = i + 1 + static_cast<size_t>(begin); j < i + 1 + static_cast<size_t>(end); ++j) {
        shared[j] = MatchFeatures(largest[i], largest[j]).size();
      }
    });
    for (size_t j = i + 1; j < count; ++j) {
      alike[i].Add(static_cast<int64_t>(j), shared[j]);
      alike[j].Add(static_cast<int64_t>(i), shared[j]);
    }
    done += static_cast<int64_t>(count - i - 1);
  }
  std::set<ImagePair> pairs;
  for (size_t i = 0; i < count; ++i) {
    for (const auto& [ignored, j] : alike[i].Cut()) {
      const auto [low, high] = std::minmax({static_cast<int64_t>(i), j});
      pairs.insert({low + 1, high + 1});
    }
  }
  return std::vector<ImagePair>(pairs.begin(), pairs.end());
}

}  // namespace meshwright
