// SPDX-License-Identifier: Apache-2.0
#include "coordinator/auth/request_rate.h"

#include <algorithm>

namespace meshwright {
namespace {

constexpr double kBurstSeconds = 2;
// Callers beyond these make those that have been quiet forgotten.
constexpr size_t kMaxCallers = 4096;

}  // namespace

bool RequestRate::Take(const std::string& caller, absl::Time now) {
  const MutexLock lock(mutex_);
  const double full = kBurstSeconds * per_second_;
  if (buckets_.size() >= kMaxCallers) {
    std::erase_if(buckets_, [&](const auto& entry) { return now - entry.second.at > absl::Seconds(kBurstSeconds); });
  }
  if (buckets_.size() >= kMaxCallers && buckets_.count(caller) == 0) return false;
  Bucket& bucket = buckets_.try_emplace(caller, Bucket{.tokens = full, .at = now}).first->second;
  const double since = std::max(0.0, absl::ToDoubleSeconds(now - bucket.at));
  bucket = {.tokens = std::min(full, bucket.tokens + since * per_second_), .at = now};
  if (bucket.tokens < 1) return false;
  bucket.tokens -= 1;
  return true;
}

}  // namespace meshwright
