#include "cli/progress_display.h"

#include <algorithm>
#include <cmath>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <unistd.h>

#include "program/console.h"

namespace meshwright {
namespace {

constexpr int kBarWidth = 24;
constexpr size_t kRecentCameras = 12;
constexpr int kLinesPerStage = 50;

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
    recent_.clear();
  }
  if (recent_.empty() || recent_.back().first < progress.done) recent_.emplace_back(progress.done, clock_.Now());
  if (recent_.size() > kRecentCameras) recent_.pop_front();
  if (style_ == Style::kBar) {
    ShowBar(progress);
  } else {
    ShowLine(progress);
  }
  std::fflush(stream_);
}

std::string ProgressDisplay::Remaining(const LocalProgress& progress) const {
  if (recent_.size() < 2) return "";
  const auto& [first_done, first_time] = recent_.front();
  const double seconds = absl::ToDoubleSeconds(clock_.Now() - first_time);
  const double left = seconds / (recent_.back().first - first_done) * (progress.total - progress.done);
  return absl::StrCat("ETA ", FormatDuration(left));
}

void ProgressDisplay::ShowBar(const LocalProgress& progress) {
  const int filled = progress.total > 0 ? kBarWidth * progress.done / progress.total : 0;
  std::string line =
      absl::StrFormat("%-20s [%s%s] %d/%d", NameOf(progress.stage), std::string(static_cast<size_t>(filled), '#'),
                      std::string(static_cast<size_t>(kBarWidth - filled), '.'), progress.done, progress.total);
  if (progress.stage == LocalStage::kCameras) {
    absl::StrAppend(&line, "  ", Shares(progress));
    if (progress.done < progress.total) absl::StrAppend(&line, "  ", Remaining(progress));
  }
  std::fprintf(stream_, "\r\033[K%s", line.c_str());
  drawn_ = true;
}

void ProgressDisplay::ShowLine(const LocalProgress& progress) {
  // A file that is read later needs no line for each of thousands of cameras.
  const int stride = std::max(1, progress.total / kLinesPerStage);
  const bool quick_stage = progress.stage != LocalStage::kCameras;
  const bool first = last_line_done_ < 0;
  const bool last = progress.done == progress.total;
  if (!first && !last && (quick_stage || progress.done < last_line_done_ + stride)) return;
  if (progress.done == last_line_done_ || (quick_stage && !first)) return;
  last_line_done_ = progress.done;
  if (quick_stage) {
    std::fprintf(stream_, "%s\n", NameOf(progress.stage).c_str());
    return;
  }
  if (first && progress.resumed_from > 0) {
    std::fprintf(stream_, "going on after camera %d\n", progress.resumed_from);
  }
  const std::string remaining = last ? "" : Remaining(progress);
  std::fprintf(stream_, "%s %d/%d  %s%s%s\n", NameOf(progress.stage).c_str(), progress.done, progress.total,
               Shares(progress).c_str(), remaining.empty() ? "" : "  ", remaining.c_str());
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
// SPDX-License-Identifier: Apache-2.0
