// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>

#include <absl/time/time.h>

#include "common/base/mutex.h"

namespace meshwright {

// How many requests each caller may make: `per_second` on average, and a burst of two seconds' worth. Thread-safe.
class RequestRate {
 public:
  explicit RequestRate(double per_second) : per_second_(per_second) {}

  // Whether one more is all right; counts it then.
  bool Take(const std::string& caller, absl::Time now);

 private:
  struct Bucket {
    double tokens = 0;
    absl::Time at;
  };
  const double per_second_;
  Mutex mutex_;
  std::map<std::string, Bucket> buckets_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace meshwright
