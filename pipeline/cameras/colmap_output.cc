// SPDX-License-Identifier: Apache-2.0
#include "pipeline/cameras/colmap_output.h"

#include <algorithm>
#include <cstdio>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

namespace meshwright {

std::string NameOf(CameraStep step) {
  switch (step) {
    case CameraStep::kChecking:
      return "checking photographs";
    case CameraStep::kFeatures:
      return "finding features";
    case CameraStep::kPairing:
      return "choosing pairs";
    case CameraStep::kMatching:
      return "matching photographs";
    case CameraStep::kVerifying:
      return "verifying pairs";
    case CameraStep::kMapping:
      return "placing cameras";
  }
  return "";
}

// "Processed file [3/25]", "Matching block [2/5]".
bool ColmapOutput::ReadCount(const std::string& line, const char* before) {
  const size_t at = line.find(before);
  if (at == std::string::npos) return false;
  int done = 0;
  int total = 0;
  const std::string counts = line.substr(at + std::string(before).size());
  const int read = std::sscanf(counts.c_str(), "%d/%d", &done, &total);
  if (read < 2 || done < 1 || total < done || total > 10'000'000) return false;
  total_ = total;
  done_ = done;
  return true;
}

bool ColmapOutput::Read(const std::string& line) {
  if (absl::StrContains(line, "ERROR") || absl::StrContains(line, "Check failed")) trouble_ = line;
  switch (step_) {
    case CameraStep::kChecking:
    case CameraStep::kPairing:
    case CameraStep::kMatching:
      return false;
    case CameraStep::kFeatures:
      return ReadCount(line, "Processed file [");
    case CameraStep::kVerifying:
      return ReadCount(line, "Matching block [");
    case CameraStep::kMapping: {
      // "Registering image #17 (5)": the fifth of this model. Another model, or another attempt, begins from 2 again.
      const size_t at = line.find("Registering image #");
      int id = 0;
      int count = 0;
      if (at == std::string::npos || std::sscanf(line.c_str() + at, "Registering image #%d (%d)", &id, &count) != 2) {
        return false;
      }
      total_ = photographs_;
      const int before = done_;
      done_ = std::clamp(count, done_, photographs_);
      return done_ > before;
    }
  }
  return false;
}

}  // namespace meshwright
