// SPDX-License-Identifier: Apache-2.0
#include "cli/camera_stage.h"

#include <csignal>
#include <string>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <unistd.h>

#include "common/base/clock.h"

namespace meshwright {
namespace {

constexpr int kBarWidth = 24;

volatile std::sig_atomic_t stop_signal = 0;

extern "C" void OnStopDuringCameras(int signal) { stop_signal = signal; }

std::string Counts(const CameraProgress& progress) {
  std::string counts = progress.total > 0 ? absl::StrCat("  ", progress.done, "/", progress.total) : std::string();
  if (progress.seconds_left >= 0 && progress.done < progress.total) {
    absl::StrAppend(&counts, "  about ", FormatDuration(progress.seconds_left), " left");
  }
  return counts;
}

}  // namespace

CameraStageDisplay::CameraStageDisplay(std::FILE* stream, bool quiet)
    : stream_(stream), quiet_(quiet), is_terminal_(::isatty(::fileno(stream)) == 1) {}

void CameraStageDisplay::End() {
  if (drawn_) std::fprintf(stream_, "\n");
  drawn_ = false;
  std::fflush(stream_);
}

void CameraStageDisplay::Say(const std::string& line) {
  if (quiet_) return;
  End();
  std::fprintf(stream_, "%s\n", line.c_str());
  std::fflush(stream_);
}

void CameraStageDisplay::Show(const CameraProgress& progress) {
  if (quiet_) return;
  if (progress.step != step_) {
    End();
    step_ = progress.step;
    tenths_shown_ = -1;
  }
  const std::string name =
      absl::StrFormat("%d/%d %-21s", static_cast<int>(progress.step) + 1, kCameraSteps, NameOf(progress.step));
  if (is_terminal_) {
    const auto filled = static_cast<size_t>(kBarWidth * progress.fraction);
    std::fprintf(stream_, "\r\033[K%s [%s%s] %2.0f%%%s", name.c_str(), std::string(filled, '#').c_str(),
                 std::string(kBarWidth - filled, '.').c_str(), 100 * progress.fraction, Counts(progress).c_str());
    drawn_ = true;
  } else if (const int tenths = progress.total > 0 ? 10 * progress.done / progress.total : 0; tenths > tenths_shown_) {
    tenths_shown_ = tenths;
    std::fprintf(stream_, "%s %2.0f%%%s\n", name.c_str(), 100 * progress.fraction, Counts(progress).c_str());
  }
  std::fflush(stream_);
}

int RunCameraStage(CameraEstimationSettings settings, const OutputSettings& output, CameraEstimate* estimate) {
  std::signal(SIGINT, OnStopDuringCameras);
  std::signal(SIGTERM, OnStopDuringCameras);
  const RealClock clock;
  CameraStageDisplay display(stderr, output.quiet);
  settings.stop = [] { return stop_signal != 0; };
  settings.say = [&](const std::string& line) { display.Say(line); };
  absl::StatusOr<CameraEstimate> estimated =
      EstimateCameras(settings, clock, [&](const CameraProgress& progress) { display.Show(progress); });
  display.End();
  if (absl::IsCancelled(estimated.status()) && stop_signal != 0) {
    std::fprintf(stderr, "meshwright: stopped; the same command goes on from where it was\n");
    return 128 + stop_signal;
  }
  if (!estimated.ok()) return Fail(estimated.status());
  *estimate = *std::move(estimated);
  display.Say(absl::StrCat("cameras of ", estimate->registered, " of ", estimate->photographs,
                           " photographs: ", settings.scene_folder));
  for (const std::string& note : estimate->notes) std::fprintf(stderr, "meshwright: note: %s\n", note.c_str());
  return kExitDone;
}

}  // namespace meshwright
