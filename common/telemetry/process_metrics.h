// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <prometheus/collectable.h>
#include <prometheus/metric_family.h>

namespace meshwright {

// What every Prometheus client tells about its process, under the names that they share: process_cpu_seconds_total,
// process_resident_memory_bytes, process_open_fds, process_max_fds, process_threads, process_start_time_seconds. What
// /proc does not tell is left out.
class ProcessMetrics : public prometheus::Collectable {
 public:
  std::vector<prometheus::MetricFamily> Collect() const override;
};

}  // namespace meshwright
