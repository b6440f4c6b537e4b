// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include <absl/time/time.h>

namespace meshwright {

// How long to wait before something that failed is tried again: `first` after the first failure, twice as long after
// each further one, `longest` at most. Both are >= 0 and first <= longest.
struct BackoffOptions {
  absl::Duration first;
  absl::Duration longest;
};

// The delay after `failures` failures in a row; none after 0 of them.
absl::Duration BackoffDelay(const BackoffOptions& options, int64_t failures);

// The delays of one caller, each at random between a half and the whole of BackoffDelay: callers who failed together do
// not come back together.
class Backoff {
 public:
  explicit Backoff(const BackoffOptions& options) : options_(options) {}

  // After another failure.
  absl::Duration Next();
  // After a success.
  void Reset() { failures_ = 0; }

 private:
  BackoffOptions options_;
  int64_t failures_ = 0;
};

}  // namespace meshwright
