// SPDX-License-Identifier: Apache-2.0
#include "common/base/process_usage.h"

#include <sys/resource.h>

namespace meshwright {

ProcessUsage MeasureProcessUsage() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return {.cpu_seconds = seconds(usage.ru_utime) + seconds(usage.ru_stime),
          .peak_rss_bytes = static_cast<int64_t>(usage.ru_maxrss) * 1024};
}

}  // namespace meshwright
