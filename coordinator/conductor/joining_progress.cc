// SPDX-License-Identifier: Apache-2.0
#include "coordinator/conductor/joining_progress.h"

#include <algorithm>

namespace meshwright {
namespace {

// Judging's part of both where nothing is known.
constexpr double kJudgingShare = 0.4;
// What judging took tells of joining within these bounds.
constexpr double kMostSlowness = 3;

}  // namespace

JoiningProgress::JoiningProgress(double judging_seconds, double joining_seconds, const Clock& clock)
    : judging_seconds_(std::max(0.0, judging_seconds)),
      joining_seconds_(std::max(0.0, joining_seconds)),
      since_begin_(clock) {}

void JoiningProgress::SetJudged(double share) { judged_ = std::clamp(share, judged_, 1.0); }

void JoiningProgress::SetJoined(double share) {
  if (!is_joining_) {
    const double took = since_begin_.Lap();
    if (judging_seconds_ > 0) slowness_ = std::clamp(took / judging_seconds_, 1 / kMostSlowness, kMostSlowness);
    is_joining_ = true;
    judged_ = 1;
  }
  joined_ = std::clamp(share, joined_, 1.0);
}

double JoiningProgress::share() const {
  const double both = judging_seconds_ + joining_seconds_;
  const double judging = both > 0 ? judging_seconds_ / both : kJudgingShare;
  return judging * judged_ + (1 - judging) * joined_;
}

double JoiningProgress::seconds_left() const {
  const double done = is_joining_ ? joined_ : judged_;
  const double expected = is_joining_ ? slowness_ * joining_seconds_ : judging_seconds_;
  if (!(expected > 0) && !(done > 0)) return -1;
  // As long as it would take at the speed so far, the more of it is done; before that what was expected.
  const double by_speed = done > 0 ? since_begin_.Seconds() / done : 0;
  const double all = expected > 0 ? done * by_speed + (1 - done) * expected : by_speed;
  return (1 - done) * all + (is_joining_ ? 0 : joining_seconds_);
}

}  // namespace meshwright
