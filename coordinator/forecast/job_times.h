// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

namespace meshwright {

// What a camera job took, as its report says.
struct JobTimes {
  int64_t rays_grown = 0;
  double preparing_seconds = 0;  // photographs, V_r, seeds: whatever there is to be grown
  double growing_seconds = 0;    // growing, filtering, refinement: in proportion to what was grown

  double seconds() const { return preparing_seconds + growing_seconds; }
};

// Zeros for what is no report: it comes from a worker.
JobTimes TimesOfReport(const std::string& report_json);

}  // namespace meshwright
