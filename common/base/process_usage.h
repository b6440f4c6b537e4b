// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace meshwright {

// What this process has used so far, as the operating system accounts it.
struct ProcessUsage {
  double cpu_seconds = 0;      // user + system
  int64_t peak_rss_bytes = 0;  // largest resident set
};

ProcessUsage MeasureProcessUsage();

}  // namespace meshwright
