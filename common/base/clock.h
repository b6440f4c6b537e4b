// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>

#include <absl/time/time.h>

namespace meshwright {

// Source of the time. Nothing else reads a clock (tests/arch), so that tests can set it.
class Clock {
 public:
  virtual ~Clock() = default;
  // What time it is. May jump either way: people and services set clocks.
  virtual absl::Time Now() const = 0;
  // Since some moment that never changes; never jumps and never goes back. For how long something takes or may take.
  virtual absl::Duration Uptime() const = 0;
};

// The machine's.
class RealClock : public Clock {
 public:
  absl::Time Now() const override;
  absl::Duration Uptime() const override;
};

// The one RealClock for those who are not given another.
const Clock& SystemClock();

// A clock that stands still until it is told to advance. For tests; thread-safe.
class ManualClock : public Clock {
 public:
  absl::Time Now() const override {
    return absl::FromUnixSeconds(1'000'000'000) + absl::Nanoseconds(uptime_ns_ + set_forward_ns_);
  }
  absl::Duration Uptime() const override { return absl::Nanoseconds(uptime_ns_.load()); }
  void Advance(absl::Duration duration) { uptime_ns_ += absl::ToInt64Nanoseconds(duration); }
  // As somebody who sets it: Now() jumps, Uptime() does not.
  void SetForward(absl::Duration duration) { set_forward_ns_ += absl::ToInt64Nanoseconds(duration); }

 private:
  std::atomic<int64_t> uptime_ns_ = 0;
  std::atomic<int64_t> set_forward_ns_ = 0;
};

// How long ago it was made. `clock` outlives it.
class Stopwatch {
 public:
  explicit Stopwatch(const Clock& clock = SystemClock()) : clock_(&clock), begin_(clock.Uptime()) {}
  absl::Duration Elapsed() const { return clock_->Uptime() - begin_; }
  double Seconds() const { return absl::ToDoubleSeconds(Elapsed()); }
  // Seconds() until now, and begins anew.
  double Lap() {
    const absl::Duration begin = begin_;
    begin_ = clock_->Uptime();
    return absl::ToDoubleSeconds(begin_ - begin);
  }

 private:
  const Clock* clock_;
  absl::Duration begin_;
};

}  // namespace meshwright
