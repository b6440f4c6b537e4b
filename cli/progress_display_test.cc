// SPDX-License-Identifier: Apache-2.0
#include "cli/progress_display.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "program/console.h"

namespace meshwright {
namespace {

using testing::HasSubstr;
using testing::Not;

// What a display writes while a reconstruction of `cameras` cameras, ten seconds each, goes by.
std::string Written(ProgressDisplay::Style style, int cameras, int resumed_from = 0) {
  char* text = nullptr;
  size_t size = 0;
  std::FILE* stream = open_memstream(&text, &size);
  ManualClock clock;
  {
    ProgressDisplay display(style, stream, clock);
    LocalProgress progress;
    for (progress.done = 0; progress.done <= cameras; ++progress.done) {
      progress.total = cameras;
      display.Show(progress);
    }
    progress.stage = LocalStage::kCameras;
    progress.resumed_from = resumed_from;
    for (progress.done = resumed_from; progress.done <= cameras; ++progress.done) {
      progress.share_grown = 0.25;
      progress.seconds_left = 10 * (cameras - progress.done);
      display.Show(progress);
      clock.Advance(absl::Seconds(10));
    }
  }
  std::fclose(stream);
  std::string written(text, size);
  std::free(text);
  return written;
}

TEST(ProgressDisplayTest, PlainLinesHaveNoControlCharactersAndAreFew) {
  const std::string text = Written(ProgressDisplay::Style::kLines, 1000);
  EXPECT_THAT(text, Not(HasSubstr("\r")));
  EXPECT_LT(std::count(text.begin(), text.end(), '\n'), 60);
  EXPECT_THAT(text, HasSubstr("cameras 1000/1000"));
  EXPECT_THAT(text, HasSubstr("25.0% not confirmed"));
  EXPECT_THAT(text, HasSubstr("about 2:46:40 left"));
}

TEST(ProgressDisplayTest, TheBarStaysOnItsLineAndKnowsHowLongItTakes) {
  const std::string text = Written(ProgressDisplay::Style::kBar, 10);
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 2);  // two stages
  EXPECT_THAT(text, HasSubstr("[############............] 5/10"));
  EXPECT_THAT(text, HasSubstr("about 0:50 left"));
}

TEST(ProgressDisplayTest, AResumedRunSaysSo) {
  EXPECT_THAT(Written(ProgressDisplay::Style::kLines, 10, 4), HasSubstr("going on after camera 4"));
}

// The mesh of a large scene takes minutes: whoever reads a log sees that it goes on, and a quick one says one line.
TEST(ProgressDisplayTest, AStageThatTakesLongSaysHowFarItIs) {
  const auto written = [](absl::Duration step) {
    char* text = nullptr;
    size_t size = 0;
    std::FILE* stream = open_memstream(&text, &size);
    ManualClock clock;
    ProgressDisplay display(ProgressDisplay::Style::kLines, stream, clock);
    LocalProgress progress = {.stage = LocalStage::kJoining, .total = 1000};
    for (; progress.done <= progress.total; progress.done += 20) {
      progress.seconds_left = 60;
      display.Show(progress);
      clock.Advance(step);
    }
    display.End();
    std::fclose(stream);
    std::string lines(text, size);
    std::free(text);
    return lines;
  };
  const std::string quick = written(absl::Milliseconds(10));
  EXPECT_EQ(std::count(quick.begin(), quick.end(), '\n'), 1) << quick;
  const std::string slow = written(absl::Seconds(2));
  EXPECT_THAT(slow, HasSubstr("joining the mesh 50%  about 1:00 left\n"));
  EXPECT_EQ(std::count(slow.begin(), slow.end(), '\n'), 11) << slow;
}

TEST(ProgressDisplayTest, QuietIsQuiet) { EXPECT_EQ(Written(ProgressDisplay::Style::kNone, 10), ""); }

TEST(ConsoleTest, NumbersForPeople) {
  EXPECT_EQ(FormatCount(0), "0");
  EXPECT_EQ(FormatCount(999), "999");
  EXPECT_EQ(FormatCount(1234567), "1,234,567");
  EXPECT_EQ(FormatCount(-123456), "-123,456");
  EXPECT_EQ(FormatDuration(65.4), "1:05");
  EXPECT_EQ(FormatDuration(7389), "2:03:09");
  EXPECT_EQ(FormatBytes(512.0 * (1 << 20)), "512 MiB");
  EXPECT_EQ(FormatBytes(1.5 * (1 << 30)), "1.5 GiB");
}

TEST(DescribeSharesTest, TheyAddUp) {
  for (int covered = 0; covered <= 1000; covered += 37) {
    for (int grown = 0; grown <= 1000; grown += 41) {
      for (const int accepted : {0, grown / 3, grown}) {
        const std::string text = DescribeShares(covered / 1000.0, grown / 1000.0, accepted / 1000.0);
        double shares[4] = {};
        ASSERT_EQ(std::sscanf(text.c_str(), "%lf%% covered before, %lf%% accepted, %lf%% not confirmed, %lf%%",
                              &shares[0], &shares[1], &shares[2], &shares[3]),
                  4);
        EXPECT_NEAR(shares[0] + shares[1] + shares[2] + shares[3], 100, 1e-9) << text;
        EXPECT_NEAR(shares[1], accepted / 10.0, 1e-9);
        EXPECT_NEAR(shares[1] + shares[2], grown / 10.0, 1e-9);
        for (const double share : shares) EXPECT_GE(share, 0) << text;
      }
    }
  }
  EXPECT_EQ(DescribeShares(0.4152, 0.4731, 0.442),
            "41.5% covered before, 44.2% accepted, 3.1% not confirmed, 11.2% empty");
}

}  // namespace
}  // namespace meshwright
