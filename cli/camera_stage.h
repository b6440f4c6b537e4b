// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdio>

#include "pipeline/cameras/estimate_cameras.h"
#include "program/console.h"

namespace meshwright {

// Shows how far the cameras are: one line that is drawn again and again on a terminal, plain lines elsewhere.
class CameraStageDisplay {
 public:
  // `stream` outlives the display.
  CameraStageDisplay(std::FILE* stream, bool quiet);
  ~CameraStageDisplay() { End(); }
  CameraStageDisplay(const CameraStageDisplay&) = delete;
  CameraStageDisplay& operator=(const CameraStageDisplay&) = delete;

  void Show(const CameraProgress& progress);
  void Say(const std::string& line);
  void End();

 private:
  std::FILE* const stream_;
  const bool quiet_;
  const bool is_terminal_;
  bool drawn_ = false;
  CameraStep step_ = CameraStep::kChecking;
  int tenths_shown_ = -1;  // of the step, in plain lines
};

// Estimates cameras with progress on stderr and says what should be photographed better. SIGINT and SIGTERM end COLMAP
// too. Returns the exit code; `estimate` is there when it is kExitDone.
int RunCameraStage(CameraEstimationSettings settings, const OutputSettings& output, CameraEstimate* estimate);

}  // namespace meshwright
