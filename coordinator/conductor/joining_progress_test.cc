// SPDX-License-Identifier: Apache-2.0
#include "coordinator/conductor/joining_progress.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

namespace meshwright {
namespace {

// What is told while judging takes `judging` seconds and joining `joining`, in steps of a hundredth, where others were
// expected.
struct Told {
  double share = 0;
  double seconds_left = 0;
  double true_seconds_left = 0;
};
std::vector<Told> Follow(double judging, double joining, double expected_judging, double expected_joining) {
  ManualClock clock;
  JoiningProgress progress(expected_judging, expected_joining, clock);
  std::vector<Told> told;
  const auto note = [&](double left) { told.push_back({progress.share(), progress.seconds_left(), left}); };
  for (int i = 0; i <= 100; ++i) {
    progress.SetJudged(i / 100.0);
    note(judging * (1 - i / 100.0) + joining);
    if (i < 100) clock.Advance(absl::Seconds(judging / 100));
  }
  for (int i = 0; i <= 100; ++i) {
    progress.SetJoined(i / 100.0);
    note(joining * (1 - i / 100.0));
    if (i < 100) clock.Advance(absl::Seconds(joining / 100));
  }
  return told;
}

TEST(JoiningProgressTest, TheShareRisesFromNothingToAll) {
  for (const auto& told : {Follow(10, 20, 10, 20), Follow(10, 20, 40, 1), Follow(10, 20, 0, 0)}) {
    EXPECT_EQ(told.front().share, 0);
    EXPECT_DOUBLE_EQ(told.back().share, 1);
    for (size_t i = 1; i < told.size(); ++i) EXPECT_GE(told[i].share, told[i - 1].share);
  }
}

TEST(JoiningProgressTest, WhatTakesAsLongAsExpectedIsToldExactly) {
  for (const Told& one : Follow(10, 20, 10, 20)) EXPECT_NEAR(one.seconds_left, one.true_seconds_left, 1e-6);
}

TEST(JoiningProgressTest, AWrongExpectationGivesWayToWhatIsMeasured) {
  for (const auto& told : {Follow(10, 20, 5, 10), Follow(10, 20, 20, 40)}) {
    EXPECT_GT(std::abs(told.front().seconds_left - told.front().true_seconds_left), 10);
    // A machine that judges at half the speed joins at half the speed.
    EXPECT_NEAR(told[101].seconds_left, 20, 1e-6);
    for (size_t i = 150; i < told.size(); ++i) EXPECT_NEAR(told[i].seconds_left, told[i].true_seconds_left, 1);
  }
}

TEST(JoiningProgressTest, NothingIsSaidWhereNothingIsKnown) {
  const std::vector<Told> told = Follow(10, 20, 0, 0);
  EXPECT_EQ(told.front().seconds_left, -1);
  EXPECT_NEAR(told[150].seconds_left, told[150].true_seconds_left, 1e-6);
  EXPECT_EQ(told.back().seconds_left, 0);
}

}  // namespace
}  // namespace meshwright
