// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <utility>

namespace meshwright {

// Told how much of a mesh has been joined, 0 .. 1, never less than before; one call at a time, from any thread.
using JoinListener = std::function<void(double share)>;

// What joining consists of, in order.
enum class JoinStage { kSketching, kLooking, kStitching, kClosing, kWriting };

// Turns steps of the stages into shares of the whole. Thread-safe.
class JoinProgress {
 public:
  explicit JoinProgress(JoinListener listener) : listener_(std::move(listener)) {}

  // One more of `total` steps of the stage.
  void Step(JoinStage stage, int64_t total) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (stage != stage_) steps_ = 0;
    stage_ = stage;
    ++steps_;
    const auto index = static_cast<size_t>(stage);
    double share = kShares[index] * static_cast<double>(steps_) / static_cast<double>(total);
    for (size_t before = 0; before < index; ++before) share += kShares[before];
    listener_(share);
  }

 private:
  // Of the time that it takes, roughly.
  static constexpr std::array<double, 5> kShares = {0.05, 0.2, 0.2, 0.4, 0.15};

  const JoinListener listener_;
  std::mutex mutex_;
  JoinStage stage_ = JoinStage::kSketching;
  int64_t steps_ = 0;
};

}  // namespace meshwright
