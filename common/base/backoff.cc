// SPDX-License-Identifier: Apache-2.0
#include "common/base/backoff.h"

#include <algorithm>
#include <random>

namespace meshwright {

absl::Duration BackoffDelay(const BackoffOptions& options, int64_t failures) {
  constexpr int64_t kMaxDoublings = 30;
  if (failures <= 0) return absl::ZeroDuration();
  return std::min(options.first * (int64_t{1} << std::min(failures - 1, kMaxDoublings)), options.longest);
}

absl::Duration Backoff::Next() {
  thread_local std::minstd_rand random{std::random_device{}()};
  return BackoffDelay(options_, ++failures_) * std::uniform_real_distribution<double>(0.5, 1.0)(random);
}

}  // namespace meshwright
