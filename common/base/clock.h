#pragma once

#include <chrono>

#include <absl/time/clock.h>
#include <absl/time/time.h>

namespace meshwright {

// Source of the time. Nothing else reads the clock, so that tests can set it.
class Clock {
 public:
  virtual ~Clock() = default;
  virtual absl::Time Now() const = 0;
};

class RealClock : public Clock {
 public:
  absl::Time Now() const override { return absl::Now(); }
};

// Goes on evenly, whatever is done to the time of day, from some moment that only this process knows: for how long
// something takes or is waited for. Stands still while the machine sleeps.
inline absl::Time MonotonicNow() {
  return absl::UnixEpoch() + absl::FromChrono(std::chrono::steady_clock::now().time_since_epoch());
}

class MonotonicClock : public Clock {
 public:
  absl::Time Now() const override { return MonotonicNow(); }
};

inline const MonotonicClock kMonotonicClock{};

// A clock that stands still until it is told to advance. For tests; not thread-safe.
class ManualClock : public Clock {
 public:
  absl::Time Now() const override { return now_; }
  void Advance(absl::Duration duration) { now_ += duration; }

 private:
  absl::Time now_ = absl::FromUnixSeconds(1'000'000'000);
};

}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
