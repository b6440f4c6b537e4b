// SPDX-License-Identifier: Apache-2.0
#include "cli/progress_display.h"

#include <algorithm>
#include <cmath>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "program/console.h"

namespace meshwright {
namespace {

constexpr int kBarWidth = 24;
constexpr int kLinesPerStage = 50;
// A stage that takes longer says how far it is.
constexpr absl::Duration kLongestSilence = absl::Seconds(10);

// "about 3:20 left"; "" while nothing can be said, and of the last seconds.
std::string Remaining(const LocalProgress& progress) {
  if (!(progress.seconds_left >= 1)) return "";
  return absl::StrCat("about ", FormatDuration(progress.seconds_left), " left");
}

// 0: not known.
size_t TerminalColumns(std::FILE* stream) {
  winsize size = {};
  const int descriptor = ::fileno(stream);
  return descriptor >= 0 && ::ioctl(descriptor, TIOCGWINSZ, &size) == 0 ? size.ws_col : 0;
}

// The mesh comes in thousandths: a number that nobody counts.
std::string Done(const LocalProgress& progress) {
  if (progress.stage != LocalStage::kJoining) return absl::StrCat(progress.done, "/", progress.total);
  return absl::StrCat(progress.total > 0 ? int64_t{100} * progress.done / progress.total : 0, "%");
}

std::string Shares(const LocalProgress& progress) {
  return absl::StrCat("rays: ", DescribeShares(progress.share_covered, progress.share_grown, progress.share_accepted));
}

}  // namespace

ProgressDisplay::Style ProgressDisplay::StyleFor(std::FILE* stream, bool quiet) {
  if (quiet) return Style::kNone;
  return ::isatty(::fileno(stream)) == 1 ? Style::kBar : Style::kLines;
}

ProgressDisplay::ProgressDisplay(Style style, std::FILE* stream, const Clock& clock)
    : style_(style), stream_(stream), clock_(clock) {}

ProgressDisplay::~ProgressDisplay() { End(); }

void ProgressDisplay::End() {
  if (drawn_) std::fprintf(stream_, "\n");
  drawn_ = false;
  std::fflush(stream_);
}

void ProgressDisplay::Show(const LocalProgress& progress) {
  if (style_ == Style::kNone) return;
  if (static_cast<int>(progress.stage) != stage_) {
    End();
    stage_ = static_cast<int>(progress.stage);
    last_line_done_ = -1;
  }
  if (style_ == Style::kBar) {
    ShowBar(progress);
  } else {
    ShowLine(progress);
  }
  std::fflush(stream_);
}

void ProgressDisplay::ShowBar(const LocalProgress& progress) {
  const int filled = progress.total > 0 ? kBarWidth * progress.done / progress.total : 0;
  std::string line =
      absl::StrFormat("%-20s [%s%s] %s", NameOf(progress.stage), std::string(static_cast<size_t>(filled), '#'),
                      std::string(static_cast<size_t>(kBarWidth - filled), '.'), Done(progress));
  if (const std::string left = Remaining(progress); !left.empty()) absl::StrAppend(&line, "  ", left);
  if (progress.stage == LocalStage::kCameras) absl::StrAppend(&line, "  ", Shares(progress));
  // What is wider than the terminal would go on in a second line, and that would stay.
  if (const size_t columns = TerminalColumns(stream_); columns > 0) line.resize(std::min(line.size(), columns - 1));
  std::fprintf(stream_, "\r\033[K%s", line.c_str());
  drawn_ = true;
}

void ProgressDisplay::ShowLine(const LocalProgress& progress) {
  // A file that is read later needs no line for each of thousands of cameras.
  const int stride = std::max(1, progress.total / kLinesPerStage);
  const bool quick_stage = progress.stage != LocalStage::kCameras;
  const bool first = last_line_done_ < 0;
  const bool last = progress.done == progress.total;
  const bool is_silent = clock_.Uptime() - last_line_at_ >= kLongestSilence;
  if (progress.done == last_line_done_ || (quick_stage && !first && !is_silent)) return;
  if (!quick_stage && !first && !last && progress.done < last_line_done_ + stride) return;
  last_line_done_ = progress.done;
  last_line_at_ = clock_.Uptime();
  const std::string remaining = Remaining(progress);
  const std::string left = remaining.empty() ? "" : absl::StrCat("  ", remaining);
  if (quick_stage) {
    const std::string done = first ? "" : absl::StrCat(" ", Done(progress));
    std::fprintf(stream_, "%s%s%s\n", NameOf(progress.stage).c_str(), done.c_str(), left.c_str());
    return;
  }
  if (first && progress.resumed_from > 0) {
    std::fprintf(stream_, "going on after camera %d\n", progress.resumed_from);
  }
  std::fprintf(stream_, "%s %s  %s%s\n", NameOf(progress.stage).c_str(), Done(progress).c_str(),
               Shares(progress).c_str(), left.c_str());
}

std::string DescribeShares(double covered_before, double grown, double accepted) {
  // In thousandths; what rounding leaves goes to the last.
  const auto thousandths = [](double share) { return std::lround(1000 * std::clamp(share, 0.0, 1.0)); };
  const long all_grown = thousandths(grown);
  const long confirmed = std::min(thousandths(accepted), all_grown);
  const long covered = std::min(thousandths(covered_before), 1000 - all_grown);
  const auto percent = [](long share) { return static_cast<double>(share) / 10; };
  return absl::StrFormat("%.1f%% covered before, %.1f%% accepted, %.1f%% not confirmed, %.1f%% empty", percent(covered),
                         percent(confirmed), percent(all_grown - confirmed), percent(1000 - covered - all_grown));
}

}  // namespace meshwright
