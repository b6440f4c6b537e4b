// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "common/base/clock.h"

namespace meshwright {

// How far a reconstruction is whose cameras are all committed: its surfaces are judged again, then joined. Belongs to
// one thread at a time.
class JoiningProgress {
 public:
  // What both will presumably take, seconds; 0 where nothing is known. `clock` outlives it.
  JoiningProgress(double judging_seconds, double joining_seconds, const Clock& clock);

  // Shares of the stage that runs, 0 .. 1; joining begins when judging has ended.
  void SetJudged(double share);
  void SetJoined(double share);

  // Of both, 0 .. 1; never falls.
  double share() const;
  // What is expected to begin with gives way to what is measured as the stage goes on. -1: nothing can be said.
  double seconds_left() const;

 private:
  const double judging_seconds_;
  const double joining_seconds_;
  Stopwatch since_begin_;  // of the stage
  double judged_ = 0;
  double joined_ = 0;
  bool is_joining_ = false;
  double slowness_ = 1;  // of judging, against what was expected
};

}  // namespace meshwright
