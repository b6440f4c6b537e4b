// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace meshwright {

// Q_open of section 3.6: patches waiting to be expanded, best quality first. Qualities are sorted into buckets of
// 1/256; within a bucket the latest comes first, which keeps neighbouring patches together in memory.
class OpenQueue {
 public:
  void Push(int32_t patch, float quality) {
    const int bucket = std::clamp(static_cast<int>((quality + 1.0F) * 0.5F * kBuckets), 0, kBuckets - 1);
    buckets_[static_cast<size_t>(bucket)].push_back(patch);
    top_ = std::max(top_, bucket);
  }

  // Takes the best `count` patches, or all when there are fewer. False when there is none.
  bool Pop(int count, std::vector<int32_t>& batch) {
    batch.clear();
    while (top_ >= 0 && static_cast<int>(batch.size()) < count) {
      std::vector<int32_t>& bucket = buckets_[static_cast<size_t>(top_)];
      if (bucket.empty()) {
        --top_;
        continue;
      }
      batch.push_back(bucket.back());
      bucket.pop_back();
    }
    return !batch.empty();
  }

 private:
  static constexpr int kBuckets = 512;
  std::array<std::vector<int32_t>, kBuckets> buckets_;
  int top_ = -1;
};

}  // namespace meshwright
