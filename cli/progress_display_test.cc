#include "cli/progress_display.h"

#include <cstdlib>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/program/console.h"

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
  EXPECT_THAT(text, HasSubstr("25% grown"));
  EXPECT_THAT(text, HasSubstr("ETA "));
}

TEST(ProgressDisplayTest, TheBarStaysOnItsLineAndKnowsHowLongItTakes) {
  const std::string text = Written(ProgressDisplay::Style::kBar, 10);
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 2);  // two stages
  EXPECT_THAT(text, HasSubstr("[############............] 5/10"));
  EXPECT_THAT(text, HasSubstr("ETA 0:50"));
}

TEST(ProgressDisplayTest, AResumedRunSaysSo) {
  EXPECT_THAT(Written(ProgressDisplay::Style::kLines, 10, 4), HasSubstr("going on after camera 4"));
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

}  // namespace
}  // namespace meshwright
