// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdio>
#include <string>

#include <absl/time/time.h>

#include "pipeline/local/local_reconstruction.h"

#include "common/base/clock.h"

namespace meshwright {

// Shows how far a reconstruction is: one line that is drawn again and again on a terminal, plain lines elsewhere.
class ProgressDisplay {
 public:
  enum class Style { kNone, kBar, kLines };
  static Style StyleFor(std::FILE* stream, bool quiet);

  // `stream` and `clock` outlive the display.
  ProgressDisplay(Style style, std::FILE* stream, const Clock& clock);
  ~ProgressDisplay();
  ProgressDisplay(const ProgressDisplay&) = delete;
  ProgressDisplay& operator=(const ProgressDisplay&) = delete;

  void Show(const LocalProgress& progress);
  // Ends the line that is being drawn; call before anything else is printed.
  void End();

 private:
  void ShowBar(const LocalProgress& progress);
  void ShowLine(const LocalProgress& progress);

  const Style style_;
  std::FILE* const stream_;
  const Clock& clock_;
  bool drawn_ = false;
  int stage_ = -1;
  int last_line_done_ = -1;
  absl::Duration last_line_at_;  // by Clock::Uptime()
};

// Where the rays of all cameras went, from shares of report.json, in percent that add up to 100: "41.5% covered before,
// 44.2% accepted, 3.1% not confirmed, 11.2% empty". A ray that was covered and has got a nearer patch
// counts as the latter.
std::string DescribeShares(double covered_before, double grown, double accepted);

}  // namespace meshwright
