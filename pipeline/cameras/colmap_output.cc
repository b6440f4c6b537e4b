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
    case CameraStep::kMatching:
      return "matching photographs";
    case CameraStep::kVerifying:
      return "verifying pairs";
    case CameraStep::kMapping:
      return "placing cameras";
  }
  return "";
}

// "Processed file [3/25]", "Matching image [3/25]", "Matching block [2/5, 3/5]": the second dimension is the faster
// one.
bool ColmapOutput::ReadCount(const std::string& line, const char* before) {
  const size_t at = line.find(before);
  if (at == std::string::npos) return false;
  int row = 0;
  int rows = 0;
  int column = 1;
  int columns = 1;
  const std::string counts = line.substr(at + std::string(before).size());
  const int read = std::sscanf(counts.c_str(), "%d/%d, %d/%d", &row, &rows, &column, &columns);
  if (read < 2 || row < 1 || rows < row || rows > 10'000'000) return false;
  if (read < 4 || column < 1 || columns < column || columns > 100'000 || rows > 20'000) column = columns = 1;
  total_ = rows * columns;
  done_ = (row - 1) * columns + column;
  return true;
}

bool ColmapOutput::Read(const std::string& line) {
  if (absl::StrContains(line, "ERROR") || absl::StrContains(line, "Check failed")) trouble_ = line;
  switch (step_) {
    case CameraStep::kChecking:
      return false;
    case CameraStep::kFeatures:
      return ReadCount(line, "Processed file [");
    case CameraStep::kMatching:
      return ReadCount(line, "Matching image [") || ReadCount(line, "Matching block [");
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
// SPDX-License-Identifier: Apache-2.0
